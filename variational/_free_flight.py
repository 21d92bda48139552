"""Free flight with a gap that keeps its relative accuracy however low it is.

Gap and normal velocity are integrated on their own from the surface, beside the state:
z' = u + w, w' = a, where u is the speed that the impact leaves and a the normal
acceleration of free flight. They keep their relative accuracy where the gap computed
from the state has lost it, so impacts 1e-12 high are as good as high ones.
"""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from jaxcam import HybridSystem
from jaxcam.hybrid import normal_acceleration


_TABLE = diffrax.Dopri8.tableau
_LAST = len(_TABLE.b_sol) - 1  # the last stage serves only dense output
_LOWER = np.zeros((_LAST, _LAST))
for _i, _row in enumerate(_TABLE.a_lower[: _LAST - 1]):
    _LOWER[_i + 1, : len(_row)] = _row
_NODES = np.concatenate([[0.0], np.asarray(_TABLE.c, dtype=float)])[:_LAST]
_WEIGHTS = np.asarray(_TABLE.b_sol, dtype=float)[:_LAST]
_ERROR = np.asarray(_TABLE.b_error, dtype=float)[:_LAST]

#: error of a step, relative to one plus the state
TOLERANCE = 1e-14
#: attempts, at most
MOST_STEPS = 4096


def runge_kutta_step(rates, s, y, h):
    """One step of length `h`: the state after it and the error estimate."""

    def stage(stages, row):
        i, lower, node = row
        k = rates(s + node * h, y + h * _combined(lower, stages))
        return stages.at[i].set(k), None

    rows = (jnp.arange(_LAST), jnp.asarray(_LOWER), jnp.asarray(_NODES))
    start = jnp.zeros((_LAST, y.shape[0]))
    stages, _ = jax.lax.scan(stage, start, rows)
    weights, wrong = jnp.asarray(_WEIGHTS), jnp.asarray(_ERROR)
    return y + h * _combined(weights, stages), h * _combined(wrong, stages)


def _combined(weights, stages):
    """Weighted sum of the stages; with derivatives a product of matrices is slower."""
    return jnp.sum(weights[:, None] * stages, axis=0)


def flight_rates(system, time, speed, n):
    """Rates of the state, of w and of z along free flight."""

    def rates(s, y):
        t, x = time + s, y[:n]
        acceleration = normal_acceleration(system, t, x)
        return jnp.concatenate(
            [system.vector_field(t, x), acceleration, (speed + y[n])[None]]
        )

    return rates


def fly(system: HybridSystem, time, state, speed, duration, height: ArrayLike = 0.0):
    """Free flight for a given time, without a look at the constraint.

    **Arguments:** as in [`variational.next_impact`][]; `duration` >= 0.

    **Returns:** state `(n,)`, gap and normal velocity at the end; the gap keeps its
    relative accuracy if the flight starts on the surface.
    """
    n = state.shape[0]
    time = jnp.asarray(time, jnp.float64)
    rates = flight_rates(system, time, speed, n)
    frozen = jax.lax.stop_gradient

    def goes_on(carry):
        share, _, _, count = carry
        return (share < 1) & (count < MOST_STEPS)

    def advance(carry):
        share, part, y, count = carry
        part = jnp.minimum(part, 1 - share)
        end, error = runge_kutta_step(rates, share * duration, y, part * duration)
        size = frozen(jnp.max(jnp.abs(error) / (TOLERANCE * (1 + jnp.abs(end)))))
        good = size <= 1
        factor = 0.9 * jnp.maximum(size, 1e-12) ** -0.125
        share = jnp.where(good, share + part, share)
        return (
            share,
            part * jnp.clip(factor, 0.2, 2.0),
            jnp.where(good, end, y),
            count + 1,
        )

    y = jnp.concatenate([state, jnp.zeros(1), jnp.asarray(height, jnp.float64)[None]])
    start = (jnp.zeros(()), jnp.asarray(1 / 8), y, 0)
    _, _, y, _ = jax.lax.while_loop(goes_on, advance, start)
    return y[:n], y[-1], speed + y[n]
