"""Evaluate orbits outside of traced programs, by the LLVM backend.

XLA takes several times as long to compile the event loop with its derivatives.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid.flow_jacobian import flow_jacobian, runs_by_llvm
from jaxcam.hybrid.programs import program

from .._evaluation import Evaluation
from .._parameter import with_leaf
from ._event_changes import values_of_events
from ._states_at_periods import states_outside_programs


def evaluated_by_llvm(problem: Any, leaf: int, z) -> Evaluation | None:
    """Return the `Evaluation` of a `SingleShooting` at z = (u, parameter); None if the
    backend cannot run it.
    """

    def evaluate() -> Evaluation:
        arrival, matrix = flow_jacobian(_period, (problem, leaf), z, problem.settings)
        states = _states(problem, leaf, z, int(arrival.code) == 0)
        found = _evaluation(problem, leaf, jnp.asarray(z), arrival, matrix, states)
        return jax.tree.map(np.asarray, found)

    return runs_by_llvm(problem.settings, (problem, z), evaluate)


def _period(given, z):
    problem, leaf = given
    u, system = z[:-1], with_leaf(problem.parameters, leaf, z[-1])
    return system, problem.start(u, system), *problem.times(u, system)


def _states(problem, leaf: int, z, successful: bool):
    """Return the states at the forcing periods, `(periods, n)`; None without forcing,
    and NaN if the motion failed.
    """
    if not problem.periods:
        return None
    system, x, start, end = _period((problem, leaf), jnp.asarray(z))
    if not successful:
        return np.full((problem.periods, len(x)), np.nan)
    return states_outside_programs(problem, x, float(start), float(end), system)


@program
def _evaluation(problem, leaf: int, z, arrival, matrix, states) -> Evaluation:
    """Return the `Evaluation`, from the end of the period and its Jacobian."""
    u, parameters = z[:-1], with_leaf(problem.parameters, leaf, z[-1])
    end = jnp.where(arrival.code == 0, arrival.state, jnp.nan)

    def closed(z, end):
        return problem.closing(end, z[:-1], with_leaf(problem.parameters, leaf, z[-1]))

    by_z, by_end = jax.jacfwd(closed, argnums=(0, 1))(z, end)
    whole = by_z + by_end @ matrix
    observed = problem.observed(arrival, u, parameters)
    if states is not None:
        observed["stroboscopic"] = states
    return Evaluation(
        closed(z, end),
        whole,
        problem.linearisation(u, parameters, whole[:, :-1]),
        values_of_events(arrival),
        observed,
    )
