"""The solution that a run has reached, and its conversion to a point."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ._context import Context
from ._other_unknowns import AbstractRestated
from ._point import ORDINARY, Point, with_parameter
from ._program import Corrected
from .predictors import Station
from .problem import AbstractProblem
from .special import eigenvalues_at, is_stable, test_values, varied


class Solution(NamedTuple):
    """The solution that a run has reached."""

    problem: AbstractProblem
    at: Corrected
    tests: dict[str, float]
    step: float
    arclength: float
    trail: tuple
    """The last points before this one, oldest first, each as (z, tangent)."""
    yielded: bool = False
    """Whether the point of this solution has already been yielded."""


def solution_at(
    problem: AbstractProblem,
    leaf: int,
    at: Corrected,
    step: float,
    arclength: float,
    trail=(),
) -> Solution:
    """Return the solution with its test functions."""
    return Solution(problem, at, test_values(problem, leaf, at), step, arclength, trail)


def solution_after(
    current: Solution, leaf: int, at: Corrected, step: float
) -> Solution:
    """Return the solution at the next point of the branch; `step` is the length of the
    step that follows it.
    """
    length = float(np.linalg.norm((at.z - current.at.z) / current.at.scale))
    trail = (*current.trail, (current.at.z, current.at.tangent))[-8:]
    following = solution_at(
        current.problem, leaf, at, step, current.arclength + length, trail
    )
    # give an exact zero the previous sign, so that the sign flips in the next step
    for name, value in following.tests.items():
        if value == 0:
            before = current.tests.get(name, 0.0)
            following.tests[name] = float(np.copysign(np.finfo(float).tiny, before))
    return following


def point_of(
    context: Context,
    current: Solution,
    label: int,
    kind: str,
    reason: str = "",
    converged: bool = True,
    coefficient: float | None = None,
    criticality: str = "",
) -> Point:
    """Return the solution as a point of the branch."""
    at, problem = current.at, current.problem
    multipliers, why = eigenvalues_at(problem, context.leaf, at)
    z = np.asarray(at.z)
    here, observed = with_parameter(problem, context.leaf, z[-1]), at.observed
    if isinstance(here, AbstractRestated):
        observed = here.stored(observed, z[:-1])
    return Point(
        label=label,
        kind=kind,
        parameter=float(z[-1]),
        state=z[:-1],
        multipliers=multipliers,
        stable=is_stable(problem, multipliers) if kind in ORDINARY else None,
        tangent=np.asarray(at.tangent),
        scale=np.asarray(at.scale),
        step=float(current.step),
        arclength=float(current.arclength),
        iterations=int(at.iterations),
        converged=bool(converged),
        reason=reason or why,
        coefficient=coefficient,
        criticality=criticality,
        observed={k: np.asarray(v) for k, v in observed.items()},
        tests=dict(current.tests),
        signature=problem.signature,
        parameters=varied(problem, z),
        problem=here,
        leaf=context.leaf,
    )


def stations(current: Solution, wanted: int) -> list[Station]:
    """Return up to `wanted` of the last points, in the scales of the current point,
    which is the last of them.
    """
    scale = current.at.scale
    trail = (*current.trail, (current.at.z, current.at.tangent))[-max(wanted, 1) :]
    return [Station(z / scale, v / scale / np.linalg.norm(v / scale)) for z, v in trail]


def changes_of(points: Sequence[Point]) -> list[Point]:
    """Return the special points at which the problem of a branch changes."""
    return [a for a, b in pairwise(points) if a.special and a.signature != b.signature]
