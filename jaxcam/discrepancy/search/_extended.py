"""Add terms to a problem, and fit states to other data."""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...fitting import Fit, Model, Parameter, Problem
from ...fitting.engine import (
    assemble,
    eliminate_states,
    free_columns,
    Layout,
    parameter_places,
    Point,
    state_steps,
    total_cost,
    Weights,
)
from ..policy import Policy
from ..terms import Term, watched, WithTerms


def extended(
    problem: Problem,
    terms: Sequence[Term],
    at: Point,
    parameters: Sequence[Parameter] = (),
) -> Problem:
    """Return the problem with more terms in the system, all with zero strength.

    **Arguments:** a problem whose system is a `WithTerms`, the terms to add, the
    starting point, and further parameters to add.
    """
    system = problem.model.system
    assert isinstance(system, WithTerms)
    before = len(system.terms)
    model: Model = eqx.tree_at(
        lambda m: m.system,
        problem.model,
        WithTerms(system.base, (*system.terms, *terms), system.coordinates),
    )
    model = watched(model)
    own = [p for k, t in enumerate(terms) for p in t.parameters(before + k)]
    more = [*own, *parameters]
    every = (*problem.parameters, *more)
    layout = Layout(model, parameter_places(model, every))
    fresh = np.array([float(p.where(model)) for p in more])
    fresh = np.tile(fresh, (len(problem.segments), 1))
    for column, one in enumerate(more):
        if one.known is not None:
            fresh[:, column] = one.known

    def wider(values):
        return jnp.asarray(np.concatenate([np.asarray(values), fresh], axis=1))

    return dataclasses.replace(
        problem,
        model=model,
        parameters=every,
        layout=layout,
        start=at._replace(values=wider(at.values)),
    )


def with_states(problem: Problem, found: Fit, weights: Weights, policy: Policy) -> Fit:
    """Return the parameters of a fit with states fitted to other data, for a test.

    The programs of the fit itself are reused: all parameters are free, with a scale of
    zero.
    """
    columns = free_columns(problem, found.free)
    local = jnp.asarray(columns.local)
    scales = jnp.zeros(local.shape)
    extras, point = problem.weighted(weights), found.point
    none = jnp.zeros(local.shape)
    costs = found.costs
    best = np.inf
    for _ in range(policy.state_iterations):
        blocks, costs_here = assemble(
            problem.layout, problem.pieces, extras, point, local, scales
        )
        total = total_cost(costs_here, extras)
        if total > best - policy.state_gain:
            break
        best, costs, kept = total, costs_here, point
        reduced = eliminate_states(blocks)
        point = point._replace(states=point.states + state_steps(reduced, none))
    return dataclasses.replace(found, point=kept, cost=best, costs=costs)
