"""Compute a period of a motion in which one impact may have zero speed.

The map over one period has a square-root singularity where an impact grazes. Here, the
time of that impact is an unknown, and its constraint does not act on the motion around
that time, so all equations are smooth at grazing.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import SwitchedSystem, SwitchedWrapping
from jaxcam.hybrid.flow_jacobian import unchecked_flow
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import gaps, impacts, normal_velocity

from .._parameter import as_jax, with_leaf


class WithLiftedGaps(SwitchedWrapping):
    """A system with switching surfaces whose constraints are moved away."""

    system: SwitchedSystem
    lifts: Float[Array, " m"]

    @property
    def inner(self) -> SwitchedSystem:
        """Return the system."""
        return self.system

    def gap(self, t, state):
        """Return the gaps of the system plus the lifts."""
        own = self.system.gap(t, state)
        return own + jnp.reshape(self.lifts, jnp.shape(own))


class Window(eqx.Module):
    """The constraint that grazes, and when it does not act on the motion."""

    constraint: Any
    """Index of the constraint."""
    begin: Any
    """Start of the interval without the constraint, as a fraction of the period."""
    end: Any
    """End of that interval."""
    lift: Any
    """Distance by which the constraint is moved away."""
    strikes: Any
    """Whether there is an impact at the unknown time."""


def equations_at(
    problem: Any, leaf: int, window: Window, rows: Float[np.ndarray, "k u2"]
) -> Float[np.ndarray, "k u2"]:
    """Return the equations of a period for several rows (unknowns, parameter, time).

    The time, as a fraction of the period, is that of the impact or of the smallest gap.
    The motion is not traced, because its program would take long to compile.

    Returns:
        For each row, the residual of the problem, the gap and the normal velocity of
        the constraint at that time, before the impact, `(k, u + 2)`; NaN if the motion
        ends early.
    """
    return np.stack([_equations(problem, leaf, window, row) for row in rows])


def _equations(problem, leaf: int, window: Window, row) -> np.ndarray:
    system = as_jax(with_leaf(problem.parameters, leaf, np.asarray(row[-2])))
    u, which = jnp.asarray(row[:-2]), int(window.constraint)
    x = problem.state(u)
    start, end = (float(time) for time in problem.times(u, system))
    shares = np.array([0.0, window.begin, row[-1], window.end, 1.0])
    times = start + shares * (end - start)
    number = jax.eval_shape(lambda y: gaps(system, start, y), x).size
    lifts = np.where(np.arange(number) == which, window.lift, 0.0)
    met = np.zeros(2)
    for piece, away in enumerate((0.0, 1.0, 1.0, 0.0)):
        moved = WithLiftedGaps(system, jnp.asarray(away * lifts))
        t0, t1 = times[piece], times[piece + 1]
        arrival = unchecked_flow(moved, x, t0, t1, problem.settings)
        if int(arrival.code) != 0:
            return np.full(row.size, np.nan)
        x = arrival.state
        if piece == 1:
            gap, speed, after = _at_constraints(system, times[2], x)
            met = np.array([gap[which], speed[which]])
            x = after[which] if window.strikes else x
    return np.concatenate([np.asarray(problem.closing(x, u, system)), met])


@program
def _at_constraints(system, t, x):
    """Return the gaps, the normal velocities, and the states after impacts."""
    return gaps(system, t, x), normal_velocity(system, t, x), impacts(system, t, x)
