"""Problems whose unknowns can be replaced where they become singular."""

import numpy as np

from ._context import Context
from ._other_unknowns import AbstractRestated
from ._program import correct
from ._solution import Solution, solution_at


def restated(context: Context, current: Solution, step: float) -> Solution | None:
    """Return the same solution with other unknowns if the present ones are about to
    become singular; otherwise None.
    """
    problem, at = current.problem, current.at
    if not isinstance(problem, AbstractRestated):
        return None
    before = current.trail[-1][0] if current.trail else None
    found = problem.restated(context.leaf, at.z, before)
    if found is None:
        return None
    problem, z, chord = found
    if chord is None:
        chord = np.zeros_like(z)
        chord[-1] = np.sign(at.tangent[-1])
    across = np.zeros_like(z)
    across[-1] = 1.0
    moved = correct(problem, context, z, across, chord)
    if not moved.success or not np.all(np.isfinite(moved.tangent)):
        return None
    fresh = solution_at(problem, context.leaf, moved, step, current.arclength)
    return fresh._replace(yielded=True)
