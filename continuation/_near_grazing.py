"""Find the folds and flips between a point at which the problem changes and the
neighbouring points of the branch.

Beyond such a point, the equations of the problem hold no orbits, and a multiplier may
be infinite at it. The test functions on both sides are therefore compared with their
values at the point itself or, if they have no limit there, just before it.
"""

from typing import Any

import numpy as np

from ._context import Context
from ._passed import located_between, sign_changes, Special, special_here
from ._program import correct, Corrected, evaluate
from ._solution import Solution, solution_at
from .problem import AbstractProblem
from .special import FLIP, FOLD, Located


# distances at which test functions without a limit are evaluated, relative to the
# distance of the neighbouring point
_SHARES = (1e-3, 1e-2, 1e-1)


def ends(problem: AbstractProblem, name: str) -> bool:
    """Return whether the problem changes at a zero of this test function."""
    monitors = problem.monitors()
    return name in monitors and monitors[name].ends


def doubtful(problem: AbstractProblem, passed: list[tuple[str, Located]]) -> bool:
    """Return whether the problem would change at a point that could not be located."""
    return any(
        ends(problem, name) and not located.converged for name, located in passed
    )


def passed_in_step(
    context: Context, current: Solution, following: Solution
) -> list[tuple[str, Located]]:
    """Return the zeros of the test functions between two points of a branch, in order.

    If the problem changes between them, the folds and flips up to that point are found
    from the test functions there.
    """
    names = sign_changes(context, current, following)
    passed = located_between(context, current, following, names)
    for k, (name, located) in enumerate(passed):
        if ends(current.problem, name) and located.converged:
            chord = located.z - current.at.z
            before = singular_before(context, current, located.z, chord)
            if before is None:
                return passed
            kept = [one for one in passed[:k] if one[0] not in (FLIP, FOLD)]
            kept = [*kept, *before]
            along = current.at.tangent / current.at.scale**2
            kept.sort(key=lambda one: float((one[1].z - current.at.z) @ along))
            return [*kept, *passed[k:]]
    return passed


def specials_between(
    context: Context, current: Solution, following: Solution
) -> list[Special]:
    """Return the special points of the step, in the order in which they are passed."""
    chord = following.at.z - current.at.z
    found = [
        special_here(context, current, chord, name, located)
        for name, located in passed_in_step(context, current, following)
    ]
    return [special for special in found if special is not None]


def singular_before(
    context: Context, current: Solution, z: np.ndarray, chord: np.ndarray
) -> list[tuple[str, Located]] | None:
    """Return the folds and flips between a point of the branch and the point z ahead of
    it at which the problem changes; None if the test functions near z are not known.

    **Arguments:** `chord`: direction of the branch.
    """
    edge = _edge(context, current.problem, z, current, chord)
    if edge is None:
        return None
    return _singular(context, current, edge)


def singular_after(
    context: Context,
    problem: AbstractProblem,
    z: np.ndarray,
    following: Solution,
) -> tuple[Solution, list[tuple[str, Located]]] | None:
    """Return the start of the branch of a problem at the point z, and the folds and
    flips between z and the first point of that branch; None if there are none.
    """
    edge = _edge(context, problem, z, following, following.at.z - z)
    found = None if edge is None else _singular(context, edge, following)
    return (edge, found) if edge is not None and found else None


def middle_of(context: Context, a: Solution, z: np.ndarray) -> Solution | None:
    """Return the solution halfway between a solution and a special point z after it.

    The length of its next step is zero, because no step begins there.
    """
    chord = z - a.at.z
    guess = a.at.z + chord / 2
    at = correct(a.problem, context, guess, chord / a.at.scale**2, chord)
    if not at.success:
        return None
    length = float(np.linalg.norm((at.z - a.at.z) / a.at.scale))
    arclength = a.arclength + length
    return solution_at(a.problem, context.leaf, at, 0.0, arclength)


def _singular(context: Context, a: Solution, b: Solution) -> list[tuple[str, Located]]:
    names = sign_changes(context, a, b)
    names = [name for name in (FLIP, FOLD) if name in names]
    found = located_between(context, a, b, names)
    return [one for one in found if one[1].converged]


def _edge(
    context: Context,
    problem: AbstractProblem,
    z: np.ndarray,
    other: Solution,
    chord: np.ndarray,
) -> Solution | None:
    """Return the solution of a problem at z or, if its test functions have no limit
    there, at a point between z and another solution.
    """
    length = float(np.linalg.norm((z - other.at.z) / other.at.scale))
    ahead = float((z - other.at.z) @ (other.at.tangent / other.at.scale**2)) > 0
    arclength = other.arclength + (length if ahead else -length)

    def known(at: Corrected) -> Solution | None:
        values = at.determinant, at.tangent, at.scale
        if not (at.success and all(np.all(np.isfinite(one)) for one in values)):
            return None
        found = solution_at(problem, context.leaf, at, other.step, arclength)
        wanted = [found.tests.get(name, 1.0) for name in (FLIP, FOLD)]
        good = all(np.isfinite(one) and one != 0 for one in wanted)
        return found if good else None

    if not problem.may_touch:
        # problems that may touch a constraint hold orbits only on one side of z
        found = known(evaluate(problem, context, z, chord))
        if found is not None:
            return found
    hits: Any = other.at.observed.get("impacts")
    way = other.at.z - z
    for share in _SHARES:
        guess = z + share * way
        at = correct(problem, context, guess, way / other.at.scale**2, chord)
        if hits is not None and float(at.observed["impacts"]) != float(hits):
            continue
        found = known(at)
        if found is not None:
            return found
    return None
