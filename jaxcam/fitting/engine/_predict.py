"""Predict one piece: its samples, its end and its joint."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...hybrid import HybridSystem, SwitchedSystem
from ...hybrid.runge_kutta import array_step, RK4
from ...hybrid.surface import gaps, impacts
from ._constant import constant
from ._model import augmented_field, DriveState, filtered_channels, Model
from ._modes import on_side_of
from ._readings import Nodes, readings
from ._switched_steps import switched_end, switched_nodes


# Steps of Newton's method
_NEWTON = 4


def fly(model: Model, state, start, step, drive: DriveState, substeps: Any = 1):
    """Integrate one piece of flight by the classical Runge-Kutta method.

    Each step is divided into `substeps` parts (a number or an integer array) for the
    values, but not for the derivatives, which need far fewer digits and cost far more.

    **Returns:** the state at the end of the piece `(n,)`, and its `Nodes`.
    """
    if isinstance(model.system, SwitchedSystem):
        states, fields, *_ = switched_nodes(model, state, start, step, drive, substeps)
    else:
        states, fields = _nodes(model, state, start, step, drive, 1)
        if not _is_one(substeps):
            still, begin = constant((model, state))
            fine = _nodes(still, begin, start, step, drive, substeps)
            states, fields = (
                coarse + jax.lax.stop_gradient(better - coarse)
                for better, coarse in zip(fine, (states, fields))
            )
    return states[-1], readings(model, states, fields, start, step, drive)


def end_of_flight(model: Model, state, start, step, drive: DriveState, substeps):
    """Return the state at the end of a piece, `(n,)`, without derivatives; `substeps`
    may be traced.
    """
    if isinstance(model.system, SwitchedSystem):
        return switched_end(model, state, start, step, drive, substeps)
    return _nodes(model, state, start, step, drive, substeps)[0][-1]


def _is_one(substeps) -> bool:
    return isinstance(substeps, int) and substeps == 1


def _nodes(model: Model, state, start, step, drive: DriveState, substeps):
    """Return the states at the ends of all steps `(n + 1, s)`, and their rates."""
    part = step / jnp.asarray(substeps, dtype=float)

    def advance(x, inputs):
        number, here = inputs
        t0 = start + number * step
        system_at = model.during(t0 + step / 2, here)
        if _is_one(substeps):
            x1, k1 = runge_kutta(model, system_at, t0, x, step)
            return x1, (x, k1)

        def inner(k, x):
            t = t0 + jnp.asarray(k, dtype=float) * part
            return runge_kutta(model, system_at, t, x, part)[0]

        k1 = augmented_field(model, system_at(t0), t0, x)
        return jax.lax.fori_loop(0, substeps, inner, x), (x, k1)

    count = drive.angle.shape[0]
    numbers = jnp.arange(count, dtype=float)
    end, (states, fields) = jax.lax.scan(advance, state, (numbers, drive))
    t1 = start + count * step
    final = DriveState(*(part[-1] for part in drive))
    system = model.during(t1 - step / 2, final)(t1)
    last = augmented_field(model, system, t1, end)
    states = jnp.concatenate([states, end[None]])
    return states, jnp.concatenate([fields, last[None]])


def runge_kutta(model: Model, system_at, t, x, h):
    """Take one classical Runge-Kutta step of length `h`.

    Args:
        model: The model.
        system_at: The system as a function of time.
        t: Time (s).
        x: State, shape `(n,)`.
        h: Step length (s).

    Returns:
        The state after the step, and the slope at its start.
    """

    def field(t, x):
        return augmented_field(model, system_at(t), t, x)

    after, _, first = array_step(RK4, field, t, x, h)
    return after, first


def rest(model: Model, guess, start, step, drive: DriveState):
    """Return `Nodes` of one piece of contact; `guess` `(n,)` is a state near the
    surface.
    """

    def channel(t, here):
        system = model.driven(t, here)

        def seen(x):
            # channels without data in contact are arbitrary here
            return jnp.stack(
                [
                    jnp.zeros_like(t)
                    if sensor.in_flight_only
                    else sensor.seen(system, t, x)
                    for sensor in model.sensors.values()
                ]
            )

        return jax.jvp(seen, *contact_state(system, t, guess))

    times = start + step * jnp.arange(drive.angle.shape[0], dtype=float)
    values, rates = jax.vmap(channel)(times, drive)
    return Nodes(values[:-1], values[1:], rates[:-1], rates[1:])


def contact_state(system, t, guess):
    """Return the state with zero gap and normal velocity nearest to `guess`, and its
    rate.

    **Returns:** two tuples of one array `(n,)`, in the form used by `jax.jvp`.
    """

    def conditions(system, t, x):
        def gap(t, x):
            return smallest_gap(system, t, x)

        value, speed = jax.jvp(
            gap, (t, x), (jnp.ones_like(t), system.vector_field(t, x))
        )
        return jnp.stack([value, speed])

    # the search and the slopes at the root need no derivatives: the residuals below
    # provide all of them
    fixed, when = constant(system), jax.lax.stop_gradient(t)

    def newton(_, carried):
        def twice(t, x):
            found = conditions(fixed, t, x)
            return found, found

        x, *_ = carried
        (by_time, slopes), found = jax.jacfwd(twice, (0, 1), has_aux=True)(when, x)
        return x - _least(slopes, found), by_time, slopes

    nothing = jnp.zeros(2), jnp.zeros((2, guess.shape[0]))
    begin = jax.lax.stop_gradient(guess), *nothing
    root, by_time, slopes = jax.lax.fori_loop(0, _NEWTON, newton, begin)
    x = root - _least(slopes, conditions(system, t, root))
    rate = -_least(slopes, by_time)
    _, changing = jax.jvp(
        lambda t, x: conditions(system, t, x), (t, x), (jnp.ones_like(t), rate)
    )
    return (x,), (rate - _least(slopes, changing),)


def _least(slopes, residual):
    """Return the smallest step that changes the two conditions by `residual`."""
    (a, b), (_, d) = slopes @ slopes.T
    det = a * d - b * b
    first, second = residual
    push = jnp.stack([d * first - b * second, a * second - b * first]) / det
    return slopes.T @ push


class Calibration(NamedTuple):
    """Offset, gain and remaining lag of each sensor, `(c,)` each."""

    offset: Float[Array, " c"]
    gain: Float[Array, " c"]
    lag: Float[Array, " c"]


def calibration(model: Model) -> Calibration:
    """Return the calibration of a model's sensors."""
    rows = [(s.offset, s.gain, s.remaining_lag) for s in model.sensors.values()]
    return Calibration(*map(jnp.stack, zip(*rows)))


def samples(
    model: Model, nodes: Nodes, sensing: Calibration, start, step, place, along
):
    """Sample every channel, shape `(n, m, c)`, by cubic Hermite polynomials.

    **Arguments:** `sensing` is the calibration of the sensors; `along` contains a time
    in each step, and the drive at that time.
    """
    u = place[..., None]
    left, right = nodes.left[:, None], nodes.right[:, None]
    a, b = step * nodes.left_rate[:, None], step * nodes.right_rate[:, None]
    # value and first and second derivatives with respect to the position in the step
    jump = right - left
    second = 3 * jump - 2 * a - b
    third = a + b - 2 * jump
    value = left + u * (a + u * (second + u * third))
    slope = a + u * (2 * second + 3 * u * third)
    bend = 2 * second + 6 * u * third
    lag = sensing.lag / step

    def sensed(value, slope, bend):
        seen = value - lag * slope + lag**2 / 2 * bend
        return sensing.offset + sensing.gain * seen

    shown = jax.vmap(jax.vmap(sensed))(value, slope, bend)
    if all(sensor.error is None for sensor in model.sensors.values()):
        return shown
    return shown + _errors(model, start, step, place, along, value, slope)


def _errors(model: Model, start, step, place, along, value, slope):
    """Return systematic errors of the sensors at each sample, `(n, m, c)`."""

    def one_step(number, places, when, drive, values, slopes):
        system = model.driven(when, drive)

        def sample(u, value, slope):
            t = start + (number + u) * step
            errors = [
                jnp.zeros(()) if one.error is None else one.error(system, t, v, s)
                for one, v, s in zip(model.sensors.values(), value, slope / step)
            ]
            return jnp.stack(errors)

        return jax.vmap(sample)(places, values, slopes)

    numbers = jnp.arange(place.shape[0], dtype=float)
    when, drive = along
    return jax.vmap(one_step)(numbers, place, when, drive, value, slope)


class Joint(NamedTuple):
    """The mismatch of two pieces relative to the joint predicted by the model.

    `state` `(n,)`: state of the later piece minus that predicted from the earlier one.
    `gap`: gap at the impact.
    """

    state: Float[Array, " n"]
    gap: Float[Array, ""]


def flight_joint(end, state) -> Joint:
    """Return the joint between two pieces of the same flight."""
    return Joint(state - end, jnp.zeros_like(end[0]))


def impact_joint(model: Model, end, state, t, drive: DriveState, reach) -> Joint:
    """Return the joint between two flights, at the time at which they have the same
    gap.

    No event search is needed: both flights and the impact between them are known.
    """
    size = end.shape[0] - len(filtered_channels(model))
    system = model.driven(t, drive)

    flights = jnp.stack([end, state])

    def moved(model, system, flights, shift):
        """Return states, gaps and their rates for both flights at another time."""

        def gap(t, x):
            return smallest_gap(system, t, x[:size])

        def move(x):
            branch = on_side_of(system, t, x[:size])
            x = runge_kutta(model, lambda t: branch, t, x, shift)[0]
            field = augmented_field(model, branch, t + shift, x)
            along = jnp.ones_like(t), field
            return x, field, *jax.jvp(gap, (t + shift, x), along)

        return jax.vmap(move)(flights)

    def step(gaps, speeds):
        slope = speeds[1] - speeds[0]
        slope = jnp.where(slope == 0, jnp.inf, slope)
        return -(gaps[1] - gaps[0]) / jax.lax.stop_gradient(slope)

    # the search needs no derivatives: its last step, from a fixed start, provides them
    fixed = constant((model, system, flights))

    def newton(_, shift):
        model, system, flights = fixed
        _, _, gaps, speeds = moved(model, system, flights, shift)
        return jnp.clip(shift + step(gaps, speeds), -reach, reach)

    shift = jax.lax.fori_loop(0, _NEWTON, newton, jnp.zeros_like(t))
    states, fields, gaps, speeds = moved(model, system, flights, shift)
    last = step(gaps, speeds)
    # selected by a condition, because the derivative of `clip` tests values for
    # equality
    inside = jnp.abs(shift + last) < reach
    last = jnp.where(inside, last, jnp.clip(shift + last, -reach, reach) - shift)
    before, after = states + last * fields
    shift = shift + last
    landed = after_impact(system, t + shift, before[:size])
    landed = jnp.concatenate([landed, before[size:]])
    return Joint(after - landed, smallest_gap(system, t + shift, before[:size]))


def after_impact(system: HybridSystem, t, x) -> Float[Array, " n"]:
    """Return the state after an impact at the smallest gap; unchanged without gaps."""
    landed = impacts(system, t, x)
    if len(landed) < 2:
        return landed[0] if len(landed) else x
    return landed[jnp.argmin(gaps(system, t, x))]


def smallest_gap(system: HybridSystem, t, x) -> Float[Array, ""]:
    """Return the smallest gap; one if the system has none.

    `min` is not used, because its derivative tests values for equality, which may fail
    if a program computes one of them twice.
    """
    found = gaps(system, t, x)
    if not len(found):
        return jnp.ones(())
    first, *others = found
    for other in others:
        first = jnp.where(other < first, other, first)
    return first
