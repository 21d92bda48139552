"""Pass a grazing at which two branches of orbits of one problem meet."""

from typing import Any, NamedTuple

import numpy as np

from ._context import Context
from ._point import with_field
from ._program import evaluate
from ._solution import Solution
from ._start import Start
from ._step import StepAttempt


# a grazing is sought within this many step lengths, and at least within a distance
# relative to the initial step: closer to it, impacts are too slow to be resolved
_REACH, _NEAR = 8.0, 1e-2


class Touch(NamedTuple):
    """A grazing orbit, with the branch that continues beyond it."""

    start: Start
    """Start of that branch at the grazing; without a tangent if none was found."""
    reason: str
    """Which constraint grazes, and what changes, as a sentence."""


def hits_differ(current: Solution, attempted: StepAttempt) -> bool:
    """Return whether the numbers of impacts at both ends of a step differ by one, in a
    problem that can locate the grazing in between.
    """
    if not current.problem.may_touch:
        return False
    after: Any = attempted.solution if attempted.at is None else attempted.at
    if after is None or "impacts" not in after.observed:
        return False
    change = after.observed["impacts"] - current.at.observed["impacts"]
    return abs(float(change)) == 1.0


def touched(
    context: Context, current: Solution, step: float
) -> tuple[Touch, Solution] | None:
    """Return the grazing near a short step, and the solution there; None if there is
    none.
    """
    reach = max(_REACH * step, _NEAR * context.settings.step)
    found = current.problem.touching(context, current.at, reach)
    if found is None:
        return None
    z = np.append(found.start.state, found.start.parameter)
    chord = z - current.at.z
    at = evaluate(current.problem, context, z, chord)
    at = with_field(at, "tangent", chord / np.linalg.norm(chord / at.scale))
    at = with_field(at, "linearisation", np.full_like(at.linearisation, np.nan))
    length = float(np.linalg.norm(chord / current.at.scale))
    arclength = current.arclength + length
    return found, Solution(current.problem, at, {}, current.step, arclength, ())
