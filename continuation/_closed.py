"""Detect a branch that returns to one of its own points."""

from typing import Any, NamedTuple

import numpy as np

from ._context import Context
from ._point import Point, with_parameter
from ._program import correct, evaluate
from ._solution import Solution, solution_at
from .problem import AbstractProblem
from .special import cubic_between


# the branch meets an earlier point if the scaled distance from that point is at most
# `_MISS` times the tolerance, limited to the range from `_LEAST` to `_MOST`; this
# allows for the errors of both points, and for digits lost near a branch point, where
# the equations are nearly singular
_MISS, _LEAST, _MOST = 1e3, 1e-8, 1e-5
# number of steps that must lie between a point and the return to it
_AWAY = 3.0
# minimum cosine of the angle between the two directions in which the branch passes the
# same point
_ALIGNED = 0.9


class Passed(NamedTuple):
    """A point passed by the branch, in one of its representations."""

    z: np.ndarray
    tangent: np.ndarray
    arclength: float
    label: int


class Past:
    """The points of a branch so far, grouped by the family of problems that they
    solve.
    """

    def __init__(self, leaf: int):
        self.leaf = leaf
        self.families: dict[str, list[Passed]] = {}

    def add(self, problem: AbstractProblem, point: Point) -> None:
        """Store an ordinary point with all its representations."""
        problem = with_parameter(problem, self.leaf, point.parameter)
        u, v = point.state, point.tangent[:-1]
        for family, state, along in problem.representation.copies(u, v):
            passed = Passed(
                np.append(state, point.parameter),
                np.append(along, point.tangent[-1]),
                point.arclength,
                point.label,
            )
            self.families.setdefault(family, []).append(passed)

    def near(
        self, current: Solution, following: Solution
    ) -> list[tuple[float, Passed]]:
        """Return the earlier points near this step, each after the fraction of the
        step at which it lies.
        """
        representation = current.problem.representation
        known = self.families.get(representation.family, [])
        known = [p for p in known if p.z.shape == current.at.z.shape]
        if not known:
            return []
        scale = current.at.scale
        chord = (following.at.z - current.at.z) / scale
        length = float(np.linalg.norm(chord))
        states = np.stack([p.z for p in known])
        states[:, :-1] = representation.brought_near(states[:, :-1], current.at.z[:-1])
        ago = current.arclength - np.array([p.arclength for p in known])
        way = (states - current.at.z) / scale
        share = way @ chord / length**2
        aside = np.linalg.norm(way - share[:, None] * chord, axis=1)
        met = (ago >= _AWAY * length) & (share > 0) & (share <= 1) & (aside <= length)
        found = [
            (float(share[k]), known[k]._replace(z=states[k]))
            for k in np.flatnonzero(met)
        ]
        return sorted(found, key=lambda item: item[0])


def closed(
    context: Context, past: Past, current: Solution, following: Solution
) -> tuple[Solution, str] | None:
    """Return the earlier point to which this step returns, and why the run ends there;
    None if the step does not return to an earlier point.

    A solution at which the equations are regular lies on only one branch. If a branch
    meets one of its points again, it is therefore a closed curve, or the same curve
    traversed backwards.
    """
    for share, passed in past.near(current, following):
        cosine = _cosine_where_met(context, current, following, share, passed)
        if cosine is None:
            continue
        back = evaluate(
            current.problem, context, passed.z, np.sign(cosine) * passed.tangent
        )
        length = float(
            np.linalg.norm((following.at.z - current.at.z) / current.at.scale)
        )
        arclength = current.arclength + share * length
        met = solution_at(
            current.problem, context.leaf, back, current.step, arclength, current.trail
        )
        where = "its start" if passed.label == 1 else f"its point {passed.label}"
        if cosine > 0:
            return met, f"the branch is closed: back at {where}"
        return met, (
            f"the branch turns back onto itself: at {where} it passes the same "
            "solutions in the other direction"
        )
    return None


def _cosine_where_met(
    context: Context,
    current: Solution,
    following: Solution,
    share: float,
    passed: Passed,
) -> float | None:
    """Return the cosine of the angle between the tangent of this step and that of the
    earlier point; None if the step misses the point, or the tangents are not aligned.
    """
    scale = current.at.scale
    chord = (following.at.z - current.at.z) / scale
    chord = chord / np.linalg.norm(chord)
    guess = cubic_between(current.at, following.at, share) / scale
    target = passed.z / scale
    # move the guess onto the plane through the earlier point
    guess = (guess + chord * float(chord @ (target - guess))) * scale
    at: Any = correct(current.problem, context, guess, chord / scale, chord * scale)
    allowed = min(max(_MISS * context.settings.tolerance, _LEAST), _MOST)
    if not at.success or np.linalg.norm(at.z / scale - target) > allowed:
        return None
    one, other = at.tangent / scale, passed.tangent / scale
    sizes = float(np.linalg.norm(one) * np.linalg.norm(other))
    cosine = float(one @ other) / sizes
    return cosine if abs(cosine) > _ALIGNED else None
