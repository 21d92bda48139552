"""Moreau's time-stepping of a hybrid system: impacts are part of a step."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..hybrid import HybridSystem
from ..hybrid.checks import check_system
from ..hybrid.surface import gaps, impacts, normal_directions, normal_velocity
from ..parameters import as_arrays, real_array, VectorLike
from ._chunks import CHUNK, in_chunks
from .complementarity import explain, lemke


class SteppedMotion(NamedTuple):
    """A motion at the ends of its steps; the first row is the start."""

    time: Float[Array, " times"]
    """(steps + 1,) s."""
    state: Float[Array, "times n"]
    """(steps + 1, n)."""
    percussion: Float[Array, "steps m"]
    """(steps, m) change of each normal velocity by impacts and contact."""
    gap: Float[Array, "times m"]
    """(steps + 1, m)."""

    def rests_from(self, constraint: int = 0) -> float:
        """The time (s) from which contact pushes in every step up to the end.

        Where chatter ends in rest this is the accumulation time, within a few steps.
        NaN where there is no contact in the last step.
        """
        pushed = np.asarray(self.percussion[:, constraint]) > 0
        if not pushed[-1]:
            return float("nan")
        free = np.flatnonzero(~pushed)
        return float(self.time[free[-1] + 1 if len(free) else 0])


def moreau(
    system: HybridSystem, state: VectorLike, t0, t1, steps: int
) -> SteppedMotion:
    """The motion from `t0` to `t1` by `steps` steps that know nothing of events.

    A step flies freely, by the midpoint rule. Where that ends behind a constraint, the
    velocities jump half way, by what complementarity asks for: each normal velocity at
    the end is at least what the impact law would leave, never negative, and more only
    where nothing pushes (after J. J. Moreau, Unilateral contact and dry friction in
    finite freedom dynamics, 1988). Impacts, several at once, chatter and sticking are
    all this one rule, nothing is tuned, and the error is of order one in the step: gaps
    are violated by as much.

    **Arguments:** any [`jaxcam.hybrid.HybridSystem`][], a state with every gap >= 0,
    times (s) and the number of steps. Each number of steps is compiled once.

    Raises:
        ValueError: Where a step has no solution, or the motion is not finite.
    """
    state = real_array(state)
    t0, t1 = float(t0), float(t1)
    if not (steps >= 1 and t1 > t0):
        raise ValueError("Give a `t1` after `t0` and at least one step.")
    system = as_arrays(system)
    check_system(system, jnp.asarray(t0), state)
    h = jnp.asarray((t1 - t0) / steps)
    start = jnp.asarray(t0)
    states, pushes, distances, codes = in_chunks(
        lambda x, k: _run(system, x, k, start, h), state, steps
    )
    explain(int(jnp.max(codes)), f" of step {int(jnp.argmax(codes > 0))}")
    if not bool(jnp.all(jnp.isfinite(states))):
        raise ValueError(
            "The motion is not finite: take more steps, or check the parameters."
        )
    times = jnp.asarray(np.linspace(t0, t1, steps + 1))
    states = jnp.concatenate([state[None], states])
    first = _gaps(system, start, state)
    return SteppedMotion(
        times, states, pushes, jnp.concatenate([first[None], distances])
    )


@eqx.filter_jit
def _run(system, state, first, t0, h):
    system = system.prepared()
    field = system.vector_field

    def step(x, k):
        t = t0 + h * k
        half = x + h / 2 * field(t, x)
        middle, end = t + h / 2, t + h
        free = x + h * field(middle, half)
        behind = gaps(system, end, free) <= 0
        directions = normal_directions(system, end, free)
        # the jump happens half way: its effect on the rest of the step is a derivative
        moves = jax.vmap(
            lambda d: d + h / 2 * jax.jvp(lambda y: field(end, y), (free,), (d,))[1]
        )(directions)

        def speed(y):
            return normal_velocity(system, end, y)

        gradient = jax.jacfwd(speed)(free)
        # what an impact half way would leave at the end; rest, where that is nothing
        after = impacts(system, middle, half)
        later = jax.vmap(lambda y: y + h / 2 * field(middle, y))(after)
        least = jnp.maximum(jnp.diagonal(jax.vmap(speed)(later)), 0.0)
        approaching = normal_velocity(system, middle, half) < 0
        least = jnp.where(approaching, least, 0.0)
        # a constraint that is not reached asks for nothing
        both = behind[:, None] & behind[None]
        matrix = jnp.where(both, gradient @ moves.T, jnp.eye(behind.shape[0]))
        vector = jnp.where(behind, speed(free) - least, 1.0)
        found = lemke(matrix, vector)
        moved = free + jnp.sum(found.z[:, None] * moves, axis=0)
        return moved, (moved, found.z, gaps(system, end, moved), found.code)

    return jax.lax.scan(step, state, first + jnp.arange(CHUNK, dtype=jnp.float64))


_gaps = eqx.filter_jit(gaps)
