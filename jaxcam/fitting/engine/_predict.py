"""Predict one piece: its samples and its joint."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...hybrid import HybridSystem
from ...hybrid.surface import gaps, impacts
from ._constant import constant
from ._fly import runge_kutta
from ._model import augmented_field, DriveState, filtered_channels, Model
from ._modes import on_side_of
from ._output import Output
from ._readings import Nodes


# Steps of Newton's method
_NEWTON = 4


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


def impact_joint(
    model: Model, end, state, t, drive: DriveState, reach, discrete=(None, None)
) -> Joint:
    """Return the joint between two flights, at the time at which they have the same
    gap.

    **Arguments:** among others, the `discrete` states of both flights, or `None`.

    No event search is needed: both flights and the impact between them are known. The
    filter of an accelerometer continues with any state, because the impact shakes it.
    """
    size = end.shape[0] - len(filtered_channels(model))
    system = model.driven(t, drive)

    flights = jnp.stack([end, state])
    both = None if discrete[1] is None else jnp.stack(discrete)

    def moved(model, system, flights, shift):
        """Return states, gaps and their rates for both flights at another time."""

        def gap(t, x):
            return smallest_gap(system, t, x[:size])

        def move(x, discrete):
            branch = on_side_of(system, t, x[:size], discrete)
            x = runge_kutta(model, lambda t: branch, t, x, shift)[0]
            field = augmented_field(model, branch, t + shift, x)
            along = jnp.ones_like(t), field
            return x, field, *jax.jvp(gap, (t + shift, x), along)

        return jax.vmap(move)(flights, both)

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
    # the shock of an impact on an accelerometer is not known
    shaken = jnp.array(
        [
            isinstance(model.sensors[name].observe, Output)
            for name in filtered_channels(model)
        ],
        dtype=bool,
    )
    filtered = jnp.where(shaken, after[size:], before[size:])
    landed = jnp.concatenate([landed, filtered])
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
