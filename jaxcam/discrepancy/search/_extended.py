"""Add terms to a problem, and fit states to other data."""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...fitting import Fit, Model, Parameter, Problem
from ...fitting.engine import (
    assemble,
    cost_by_recording,
    eliminate_states,
    free_columns,
    Layout,
    parameter_places,
    Point,
    state_steps,
    Weights,
)
from ..policy import Policy
from ..terms import Term, watched, WithTerms


# A step that worsens the fit of a recording is shortened by this factor, and abandoned
# below this fraction of its length
_SHORTER, _SHORTEST = 0.25, 0.05


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
        dataclasses.replace(system, terms=(*system.terms, *terms)),
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
    """Return the fit with its states refitted to other data, on which its parameters
    are tested.

    The parameters keep their values. They are formally free, with a scale of zero, so
    that the compiled programs of the fit are reused.
    """
    local = jnp.asarray(free_columns(problem, found.free).local)
    scales, none = jnp.zeros(local.shape), jnp.zeros(local.shape)
    extras = problem.weighted(weights)

    def about(states):
        point = found.point._replace(states=states)
        blocks, costs = assemble(
            problem.layout, problem.pieces, extras, point, local, scales
        )
        steps = state_steps(eliminate_states(blocks), none)
        costs = jax.tree.map(np.asarray, costs)
        return cost_by_recording(costs, weights), costs, np.asarray(steps)

    states = np.asarray(found.point.states)
    each, costs, steps = about(jnp.asarray(states))
    # each recording has its own step length, shortened if the fit became worse
    share = np.ones(len(states))
    for _ in range(policy.state_iterations):
        moved = states + share[:, None, None] * np.nan_to_num(steps)
        there, costs_there, steps_there = about(jnp.asarray(moved))
        better = there < np.where(np.isfinite(each), each, np.inf)
        with np.errstate(invalid="ignore"):
            close = np.abs(there - each) < policy.state_gain

        def kept(new, old):
            return np.where(better.reshape(-1, *[1] * (old.ndim - 1)), new, old)

        states, steps, each, costs = jax.tree.map(
            kept, (moved, steps_there, there, costs_there), (states, steps, each, costs)
        )
        share = np.where(better, 1.0, _SHORTER * share)
        if np.all(close | (share < _SHORTEST)):
            break
    point = found.point._replace(states=jnp.asarray(states))
    return dataclasses.replace(
        found, point=point, cost=float(np.sum(each)), costs=costs
    )
