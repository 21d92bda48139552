"""Start a fit from one of another problem."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from ...fitting import Fit, Problem
from ...fitting.engine import own_states, Point


def starting_at(found: Fit, problem: Problem) -> Point:
    """Return the point of a fit as the start of another problem, which has some of its
    recordings.

    The states are those of the fit in recordings that are divided into the same pieces;
    in the others, they are estimated from the samples.
    """
    values = np.array(problem.start.values)
    rows = [found.problem.records.index(name) for name in problem.records]
    known = np.asarray(found.point.values)[rows]
    for column, name in enumerate(problem.names):
        if name in found.problem.names:
            values[:, column] = known[:, found.problem.names.index(name)]
    point = problem.start._replace(values=jnp.asarray(values))
    if _divided_alike(found.problem, problem, rows):
        _, states, discrete = (
            None if one is None else jnp.asarray(np.asarray(one)[rows])
            for one in found.point
        )
        return point._replace(states=states, discrete=discrete)
    return own_states(problem.layout, problem.pieces, problem.extras, point)


def _divided_alike(one: Problem, other: Problem, rows: Sequence[int]) -> bool:
    """Return whether the recordings of a problem are divided as in another one, where
    they have the indices `rows`.
    """
    for name in ("start", "step", "value"):
        mine = np.asarray(getattr(one.pieces.flown, name))[rows]
        if not np.array_equal(mine, np.asarray(getattr(other.pieces.flown, name))):
            return False
    return True
