"""Take one attempted step: accept it, shorten it, or end it at the surface.

This is separate from the event loop of `jaxcam.hybrid`, because a switch changes the
field and not the state: there are no impacts, and a step ends on the surface.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..hybrid.runge_kutta import array_step, DOPRI5
from ._system import FilippovSystem
from .modes import levels, mode_after, mode_field, onto_surface


NOTHING, STEP, EVENT = 0, 1, 2
RUNNING, DONE, FAILED, NOT_FINITE = 0, 1, 2, 3

# an event beyond this fraction of the step is reached by a series, whose error is of
# third order in the rest
_CLOSE = 1e-5
_RETAKES = 80


class FilippovState(NamedTuple):
    """The state of a motion during the simulation."""

    t: Any
    x: Any
    mode: Any
    step: Any
    """Length of the next step, and of the last step that was not shortened by an
    event.
    """
    natural: Any
    failures: Any
    status: Any


class StepRow(NamedTuple):
    """The outcome of an attempted step: its kind, and the time, state, mode and level
    after it.
    """

    kind: Any
    t: Any
    x: Any
    mode: Any
    level: Any


def in_mode(system: FilippovSystem, mode, t, x, h):
    """Take a step along the active field; sliding stays on the surface."""

    def field(s, y):
        return mode_field(system, mode, s, y)

    # fifth order: over its steps, a level is nearly cubic, so its minima are detected
    after, error, _ = array_step(DOPRI5, field, t, x, h, unrolled=True)
    held = onto_surface(system, t + h, after)
    return jnp.where(mode == 0, held, after), error


def attempt(
    system: FilippovSystem, tolerance, t1, carried: FilippovState
) -> tuple[FilippovState, StepRow]:
    """Attempt one step towards `t1`; a motion that has ended does not change."""
    active = carried.status == RUNNING
    wanted = jax.lax.stop_gradient(carried.step)
    last = carried.t + wanted >= t1
    h = jnp.where(last, t1 - carried.t, wanted)
    end = jnp.where(last, t1, carried.t + h)
    after, error = in_mode(system, carried.mode, carried.t, carried.x, h)
    scale = tolerance * (1 + jnp.maximum(jnp.abs(carried.x), jnp.abs(after)))
    effort = jnp.sqrt(jnp.mean((error / scale) ** 2))
    finite = jnp.all(jnp.isfinite(after)) & jnp.isfinite(effort)
    fits = finite & (effort <= 1)

    def rates(t, x):
        field = mode_field(system, carried.mode, t, x)
        return jax.jvp(
            lambda s, y: levels(system, carried.mode, s, y),
            (t, x),
            (jnp.ones_like(t), field),
        )

    level0, rate0 = rates(carried.t, carried.x)
    level1, rate1 = rates(end, after)
    fall = rate1 < 0
    offset = jnp.where(fall, -level1 / jnp.where(fall, rate1, 1.0), 0.0)
    through = level1 < 0
    # smallest difference of two times
    blur = 1e-14 * (1 + jnp.abs(end))
    reached = fall & (jnp.abs(offset) <= _CLOSE * h + blur)
    where = jnp.where(
        through,
        jnp.where(fall, 1 + offset / h, 0.5),
        _dip(level0, h * rate0, level1, h * rate1),
    )
    beyond = where < 1
    part = jnp.min(jnp.where(beyond & ~reached, where, 1.0))
    lands = jnp.any(reached) & (part >= 1) & fits & active
    which = jnp.argmin(jnp.where(reached, offset, jnp.inf))
    retake = fits & (part < 1)
    good = fits & ~retake & active

    # the event: the remaining time follows from a series, which also carries its
    # derivative
    delta = jnp.where(lands, offset[which], 0.0)

    def field(t, x):
        return mode_field(system, carried.mode, t, x)

    first = field(end, after)
    _, second = jax.jvp(field, (end, after), (jnp.ones_like(end), first))
    landed = after + delta * (first + delta / 2 * second)
    t2 = end + delta
    landed = jnp.where(lands, onto_surface(system, t2, landed), after)
    mode2 = jnp.where(
        lands, mode_after(system, carried.mode, which, t2, landed), carried.mode
    )

    grown = 0.9 * jnp.maximum(effort, 1e-10) ** (-1 / DOPRI5.order)
    factor = jnp.where(finite, jnp.clip(grown, 0.2, 5.0), 0.2)
    cut = jnp.clip(part, 0.02, 0.98)
    natural = jnp.where(good & ~lands & ~last, h * factor, carried.natural)
    step = jnp.where(fits, jnp.where(retake, h * cut, natural), h * factor)
    failures = jnp.where(good, 0.0, carried.failures + 1)
    stuck = failures > _RETAKES
    done = good & ~lands & last
    status = jnp.where(
        done,
        DONE,
        jnp.where(stuck, jnp.where(finite, FAILED, NOT_FINITE), RUNNING),
    )
    kind = jnp.where(good, jnp.where(lands, EVENT, STEP), NOTHING)

    def keep(new, old):
        return jnp.where(good, new, old)

    moved = FilippovState(
        t=keep(t2, carried.t),
        x=keep(landed, carried.x),
        mode=keep(mode2, carried.mode),
        step=jax.lax.stop_gradient(jnp.where(active, step, carried.step)),
        natural=jax.lax.stop_gradient(jnp.where(active, natural, carried.natural)),
        failures=jnp.where(active, failures, carried.failures),
        status=jnp.where(active, status, carried.status),
    )
    return moved, StepRow(kind, moved.t, moved.x, moved.mode, which)


def _dip(value0, slope0, value1, slope1):
    """Return the position at which the cubic through two ends is below zero; 1 if it
    never is.

    The position is that of its minimum, as a fraction of the step.
    """
    a = 2 * (value0 - value1) + slope0 + slope1
    b = -3 * (value0 - value1) - 2 * slope0 - slope1
    # a stationary point with p'' > 0: 3 a s^2 + 2 b s + slope0 = 0
    root = jnp.sqrt(jnp.maximum(b * b - 3 * a * slope0, 0.0))
    divisor = b + jnp.where(b >= 0, root, -root)
    divisor = jnp.where(divisor == 0, 1.0, divisor)
    flat = jnp.where(a == 0, 1.0, a)
    by_sum = -slope0 / divisor
    other = jnp.where(a == 0, by_sum, -divisor / (3 * flat))
    s = jnp.where(b >= 0, by_sum, other)
    low = value0 + s * (slope0 + s * (b + s * a))
    slack = 1e-12 * jnp.maximum(jnp.abs(value0), jnp.abs(value1))
    inside = (s > 0) & (s < 1) & (b * b - 3 * a * slope0 > 0)
    return jnp.where(inside & (low < -slack), s, 1.0)
