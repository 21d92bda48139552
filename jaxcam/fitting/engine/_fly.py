"""Integrate one piece of flight, with or without derivatives."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...hybrid import SwitchedSystem
from ...hybrid.runge_kutta import array_step, RK4
from ._constant import constant
from ._model import augmented_field, DriveState, Model
from ._readings import Nodes, readings
from ._switched_steps import Flight, switched_end, switched_flight, switched_nodes


def flight_with_substeps(
    model: Model,
    state,
    start,
    step,
    drive: DriveState,
    substeps: Any = 1,
    discrete=None,
) -> Flight:
    """Return the motion of a piece with substeps, without derivatives.

    **Arguments:** as for `fly`.
    """
    if isinstance(model.system, SwitchedSystem):
        given = model, state, start, step, drive, substeps
        return switched_flight(*given, discrete=discrete)
    given = constant((model, state, start, step, drive))
    model, state, start, step, drive = given
    states, rates = _nodes(model, state, start, step, drive, substeps)
    return Flight(states, rates)


def fly_about(
    flight: Flight,
    model: Model,
    state,
    start,
    step,
    drive: DriveState,
) -> tuple[Float[Array, " s"], Nodes]:
    """Return the values of a flight, with the derivatives of one that is integrated
    without substeps: derivatives need far fewer digits and cost far more.

    **Returns:** as `fly`.
    """
    given = model, state, start, step, drive
    if flight.located is not None:
        found = switched_nodes(*given, flight)
    else:
        found = _nodes(*given, 1)
    states, rates = (
        coarse + jax.lax.stop_gradient(better - coarse)
        for better, coarse in zip((flight.states, flight.rates), found)
    )
    return states[-1], readings(model, states, rates, start, step, drive)


def fly(
    model: Model,
    state,
    start,
    step,
    drive: DriveState,
    substeps: Any = 1,
    discrete=None,
) -> tuple[Float[Array, " s"], Nodes]:
    """Integrate one piece of flight by the classical Runge-Kutta method.

    Each step is divided into `substeps` parts (a number or an integer array) for the
    values, but not for the derivatives. The piece begins in the `discrete` state of
    this index, or in that which the system determines.

    **Returns:** the state at the end of the piece `(n,)`, and its `Nodes`.
    """
    given = model, state, start, step, drive
    if _is_one(substeps) and not isinstance(model.system, SwitchedSystem):
        states, rates = _nodes(*given, 1)
        return states[-1], readings(model, states, rates, start, step, drive)
    return fly_about(flight_with_substeps(*given, substeps, discrete), *given)


def fly_without_derivatives(
    model: Model,
    state,
    start,
    step,
    drive: DriveState,
    substeps: Any = 1,
    discrete=None,
) -> tuple[Float[Array, " s"], Nodes]:
    """Return the same as `fly`, without derivatives, by a smaller program."""
    given = model, state, start, step, drive
    flight = flight_with_substeps(*given, substeps, discrete)
    return flight.states[-1], readings(
        model, flight.states, flight.rates, start, step, drive
    )


def end_of_flight(
    model: Model, state, start, step, drive: DriveState, substeps, discrete=None
):
    """Return the state at the end of a piece, `(n,)`, without derivatives; `substeps`
    may be traced.
    """
    if isinstance(model.system, SwitchedSystem):
        return switched_end(model, state, start, step, drive, substeps, discrete)
    return _nodes(model, state, start, step, drive, substeps)[0][-1]


def _is_one(substeps) -> bool:
    return isinstance(substeps, int) and substeps == 1


def _nodes(model: Model, state, start, step, drive: DriveState, substeps):
    """Return the states at the ends of all steps `(n + 1, s)`, and their rates."""
    count = drive.angle.shape[0]

    def advance(x, inputs):
        number, within, length, here = inputs
        t0, h = start + number * step, length * step
        system_at = model.during(start + (within + 0.5) * step, here)
        if _is_one(substeps):
            x1, k1 = runge_kutta(model, system_at, t0, x, h)
            return x1, (x, k1)
        part = h / jnp.asarray(substeps, dtype=float)

        def inner(k, given):
            x, k1 = given
            t = t0 + jnp.asarray(k, dtype=float) * part
            x1, rate = runge_kutta(model, system_at, t, x, part)
            return x1, jnp.where(k == 0, rate, k1)

        x1, k1 = jax.lax.fori_loop(0, substeps, inner, (x, jnp.zeros_like(x)))
        return x1, (x, k1)

    # a last step of length zero gives the rate at the end: the vector field is compiled
    # once only
    numbers = jnp.arange(count + 1, dtype=float)
    within = jnp.minimum(numbers, count - 1.0)
    lengths = jnp.where(numbers < count, 1.0, 0.0)
    every = jax.tree.map(lambda one: jnp.concatenate([one, one[-1:]]), drive)
    _, found = jax.lax.scan(advance, state, (numbers, within, lengths, every))
    return found


def runge_kutta(model: Model, system_at, t, x, h):
    """Take one classical Runge-Kutta step of length `h`.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        model: The model.
        system_at: The system as a function of time.
        t: Time (s).
        x: State, shape `(n,)`.
        h: Step length (s).

    Returns:
        The state after the step, and the slope at its start.

    Examples:
        >>> from jaxcam.fitting.engine import runge_kutta
        >>> state = jnp.array([1.0, 0.0])
        >>> after, _ = runge_kutta(model, lambda t: model.system, 0.0, state, 0.2)
        >>> np.asarray(after).round(6).tolist()  # 1 - g t^2 / 2 and -g t
        [0.8038, -1.962]
    """

    def field(t, x):
        return augmented_field(model, system_at(t), t, x)

    after, _, first = array_step(RK4, field, t, x, h)
    return after, first
