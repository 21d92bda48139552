"""Simulate a hybrid system by Moreau's time-stepping method."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..hybrid import HybridSystem, Settings
from ..hybrid.checks import check_system
from ..hybrid.programs import program
from ..hybrid.surface import gaps, impacts, normal_directions, normal_velocity
from ..parameters import as_arrays, real_array, VectorLike
from ._chunks import CHUNK, in_chunks
from .complementarity import explain, lemke


class SteppedMotion(NamedTuple):
    """A motion sampled at the ends of the time steps; the first row is the initial
    state.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.timestepping import moreau
        >>> moreau(BouncingBall(), [1.0, 0.0], 0.0, 1.0, 100).percussion.shape
        (100, 1)
    """

    time: Float[Array, " times"]
    """Times (s), shape `(steps + 1,)`."""
    state: Float[Array, "times n"]
    """States, shape `(steps + 1, n)`."""
    percussion: Float[Array, "steps m"]
    """Jump of each normal velocity in each step due to the percussion (impulse) at its
    own constraint, shape `(steps, m)`.
    """
    gap: Float[Array, "times m"]
    """Gaps, shape `(steps + 1, m)`."""

    def rests_from(self, constraint: int = 0) -> float:
        """Return the time (s) from which contact persists in every step to the end of
        the run.

        If chatter ends in contact, this is the accumulation time to within a few steps.

        Returns:
            The time; NaN if there is no contact in the last step.
        """
        pushed = np.asarray(self.percussion[:, constraint]) > 0
        if not pushed[-1]:
            return float("nan")
        free = np.flatnonzero(~pushed)
        return float(self.time[free[-1] + 1 if len(free) else 0])


def moreau(
    system: HybridSystem,
    state: VectorLike,
    t0,
    t1,
    steps: int,
    *,
    progress: Callable[[float], None] | None = None,
) -> SteppedMotion:
    """Simulate from `t0` to `t1` in `steps` steps by Moreau's time-stepping scheme,
    without event detection.

    Each step integrates free flight by the midpoint rule. If the step ends with a
    constraint violated, the velocities jump at mid-step according to a complementarity
    condition: each normal velocity at the end is at least the value given by the
    impact law, never negative, and larger only if no impulse acts (after J. J.
    Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988).
    Impacts, simultaneous impacts, chatter and sticking all follow from this rule
    without tuning. The error and the penetration of constraints are of first order in
    the step length.

    Args:
        system: The system.
        state: Initial state with every gap >= 0, shape `(n,)`.
        t0: Start time (s).
        t1: End time (s).
        steps: Number of steps.
        progress: Called with the fraction of steps completed.

    Returns:
        A [`jaxcam.timestepping.SteppedMotion`][].

    Raises:
        ValueError: A step has no solution, or the state becomes infinite or NaN.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.timestepping import moreau
        >>> moreau(BouncingBall(), [1.0, 0.0], 0.0, 1.0, 100).state.shape
        (101, 2)
    """
    state = real_array(state)
    t0, t1 = float(t0), float(t1)
    if not (steps >= 1 and t1 > t0):
        raise ValueError("Give a `t1` after `t0` and at least one step.")
    system = as_arrays(system)
    check_system(system, jnp.asarray(t0), state, Settings())
    h = jnp.asarray((t1 - t0) / steps)
    start = jnp.asarray(t0)
    states, pushes, distances, codes = in_chunks(
        lambda x, k: _run(system, x, k, start, h), state, steps, progress
    )
    explain(int(jnp.max(codes)), f" of step {int(jnp.argmax(codes > 0))}")
    if not bool(jnp.all(jnp.isfinite(states))):
        raise ValueError(
            "The motion is not finite: use more steps, or check the parameters."
        )
    times = jnp.asarray(np.linspace(t0, t1, steps + 1))
    states = jnp.concatenate([state[None], states])
    first = _gaps(system, start, state)
    return SteppedMotion(
        times, states, pushes, jnp.concatenate([first[None], distances])
    )


@program
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
        # the jump occurs at mid-step; its effect on the rest of the step is found by
        # differentiation
        moves = jax.vmap(
            lambda d: d + h / 2 * jax.jvp(lambda y: field(end, y), (free,), (d,))[1]
        )(directions)

        def speed(y):
            return normal_velocity(system, end, y)

        gradient = jax.jacfwd(speed)(free)
        # lower bound of the normal velocity at the end: that after an impact at
        # mid-step, or zero if there is none
        after = impacts(system, middle, half)
        later = jax.vmap(lambda y: y + h / 2 * field(middle, y))(after)
        least = jnp.maximum(jnp.diagonal(jax.vmap(speed)(later)), 0.0)
        approaching = normal_velocity(system, middle, half) < 0
        least = jnp.where(approaching, least, 0.0)
        # a constraint that is not reached imposes no condition
        both = behind[:, None] & behind[None]
        matrix = jnp.where(both, gradient @ moves.T, jnp.eye(behind.shape[0]))
        vector = jnp.where(behind, speed(free) - least, 1.0)
        found = lemke(matrix, vector)
        moved = free + jnp.sum(found.z[:, None] * moves, axis=0)
        return moved, (moved, found.z, gaps(system, end, moved), found.code)

    return jax.lax.scan(step, state, first + jnp.arange(CHUNK, dtype=jnp.float64))


_gaps = program(gaps)
