"""Compute a period of a motion in which one impact may have zero speed.

The map over one period has a square-root singularity where an impact grazes. Here, the
time of that impact is an unknown, and its constraint does not act on the motion around
that time, so all equations are smooth at grazing.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import flow, SwitchedSystem, SwitchedWrapping
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import gaps, impacts, normal_velocity

from .._parameter import with_leaf


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


@program
def equations_at(problem: Any, leaf: int, window: Window, rows: Float[Array, "k u2"]):
    """Return the equations of a period for several rows (unknowns, parameter, time).

    The time, as a fraction of the period, is that of the impact or of the smallest gap.

    Returns:
        For each row, the residual of the problem, the gap and the normal velocity of
        the constraint at that time, before the impact, `(k, u + 2)`.
    """
    return jax.vmap(lambda row: _equations(problem, leaf, window, row))(rows)


def _equations(problem, leaf: int, window: Window, row):
    system = with_leaf(problem.parameters, leaf, row[-2])
    u, which = row[:-2], window.constraint
    x = problem.state(u)
    start, end = problem.times(u, system)
    shares = jnp.stack([jnp.zeros(()), window.begin, row[-1], window.end, jnp.ones(())])
    times = start + shares * (end - start)
    number = gaps(system, start, x).shape[0]
    lifts = jnp.where(jnp.arange(number) == which, window.lift, 0.0)
    away = jnp.outer(jnp.array([0.0, 1.0, 1.0, 0.0]), lifts)
    strikes = jnp.array([False, True, False, False]) & window.strikes

    def piece(x, part):
        t0, t1, lifts, strikes = part
        moved = WithLiftedGaps(system, lifts)
        arrival = flow(moved, x, t0, t1, settings=problem.settings)
        y = jnp.where(arrival.code == 0, arrival.state, jnp.nan)
        met = gaps(system, t1, y)[which], normal_velocity(system, t1, y)[which]
        return jnp.where(strikes, impacts(system, t1, y)[which], y), jnp.stack(met)

    parts = times[:-1], times[1:], away, strikes
    arrived, met = jax.lax.scan(piece, x, parts)
    off = problem.closing(arrived, u, system)
    return jnp.concatenate([off, met[1]])
