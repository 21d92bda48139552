"""Handle declared times of abrupt change: no step reaches across one.

Between two such times, the functions are evaluated strictly inside the interval, so a
switch at the time itself may be written with `<` or `<=`. Times that are not close to a
breakpoint are used unchanged, because even a shift of the order of rounding would move
a wall away from a detected impact.
"""

import jax
import jax.numpy as jnp


# smallest distance from a breakpoint at which functions are evaluated, as a fraction of
# the time: more than the rounding error of a phase computed from the time
_SIDE = 2e-15


def declared(system) -> tuple:
    """Return the breakpoints of a system (s), one scalar each."""
    times = system.breakpoints
    if times is None:
        return ()
    times = jnp.ravel(jnp.asarray(times, dtype=jnp.float64))
    return tuple(times[k] for k in range(times.shape[0]))


def next_breakpoint(breaks, repeat, t):
    """Return the first breakpoint after `t`; breakpoints recur every `repeat` (s), or
    never if it is inf.
    """
    return neighbours(breaks, repeat, t)[1]


def neighbours(breaks, repeat, t):
    """Return the last breakpoint at or before `t` and the first after `t`; -inf and inf
    if there is none.

    Breakpoints recur every `repeat` (s), or never if it is inf.
    """
    behind, ahead = -jnp.inf, jnp.inf
    recurs = jnp.isfinite(repeat)
    again = jnp.where(recurs, repeat, 1.0)
    for b in breaks:
        turns = jnp.floor(jax.lax.stop_gradient((t - b) / again)) + 1
        turns = jnp.where(recurs, turns, 0.0)
        # because of rounding, this time may not be after `t`
        turns = jnp.where(recurs & (b + turns * again <= t), turns + 1, turns)
        time = b + turns * again
        past = jnp.where(recurs, b + (turns - 1) * again, b)
        ahead = jnp.minimum(ahead, jnp.where(time > t, time, jnp.inf))
        behind = jnp.maximum(behind, jnp.where(past <= t, past, -jnp.inf))
    return behind, ahead


def between(t, low, high, span):
    """Return the time `t` moved inside (low, high), without changing its derivative."""
    inside = jnp.maximum(after(low, span), jnp.minimum(t, before(high, span)))
    return t + jax.lax.stop_gradient(inside - t)


def after(t, span):
    """Return a time just after `t`, which may be -inf; `span` (s) is the length of the
    run.
    """
    finite = jnp.where(jnp.isfinite(t), t, 0.0)
    return t + jax.lax.stop_gradient(_SIDE * (jnp.abs(finite) + span))


def before(t, span):
    """Return a time just before `t`, which may be inf."""
    finite = jnp.where(jnp.isfinite(t), t, 0.0)
    return t - jax.lax.stop_gradient(_SIDE * (jnp.abs(finite) + span))
