"""Start from values that the recordings do not share, such as unknown phases."""

import dataclasses
import math
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from ...fitting import fit, Problem
from ...fitting.engine import own_states


def with_own_values(problem: Problem, rig: Sequence[str]) -> Problem:
    """Return the problem with starting values of the parameters that differ between
    recordings, found by a fit that tries several of them.

    From a phase that is wrong by more than a quarter of a turn, a fit with terms may
    end in a local minimum, where these terms only make up for the wrong phase.

    **Arguments:** `rig`: names of the rig parameters.
    """
    own = [
        one.name
        for one in problem.parameters
        if one.name in rig and one.per_record and math.isfinite(one.tolerance)
    ]
    if not own:
        return problem
    found = fit(problem, free=rig)
    if not math.isfinite(found.cost):
        return problem
    columns = [problem.names.index(name) for name in own]
    first = np.asarray(problem.start.values)
    values = first.copy()
    values[:, columns] = np.asarray(found.point.values)[:, columns]
    stated = {name: float(first[0, k]) for name, k in zip(own, columns, strict=True)}
    parameters = tuple(
        dataclasses.replace(one, nominal=stated[one.name])
        if one.name in stated and one.nominal is None
        else one
        for one in problem.parameters
    )
    point = problem.start._replace(values=jnp.asarray(values))
    point = own_states(problem.layout, problem.pieces, problem.extras, point)
    return dataclasses.replace(problem, parameters=parameters, start=point)
