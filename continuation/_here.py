"""Where a walk along a branch stands, and what it hands out of it."""

from typing import NamedTuple

import numpy as np

from ._locate import Walk
from ._point import Point, with_parameter
from ._problem import AbstractProblem
from ._program import Corrected
from ._test_functions import eigenvalues_of, is_stable, test_values


class Here(NamedTuple):
    """The point that the walk stands at."""

    problem: AbstractProblem
    at: Corrected
    tests: dict[str, float]
    step: float
    arclength: float
    #: points passed, oldest first, as states with their tangents
    trail: tuple
    #: whether its point has been handed out
    told: bool = False


def stand(
    problem: AbstractProblem, at: Corrected, step: float, arclength: float, trail=()
) -> Here:
    """Stand at a solution."""
    return Here(problem, at, test_values(problem, at), step, arclength, trail)


def point_of(
    walk: Walk,
    here: Here,
    label: int,
    kind: str,
    reason: str = "",
    converged: bool = True,
    coefficient: float | None = None,
    criticality: str = "",
) -> Point:
    """The solution that the walk stands at, as it is handed out."""
    at, problem = here.at, here.problem
    multipliers = eigenvalues_of(at.linearisation)
    z = np.asarray(at.z)
    return Point(
        label=label,
        kind=kind,
        parameter=float(z[-1]),
        state=z[:-1],
        multipliers=multipliers,
        stable=is_stable(problem, multipliers),
        tangent=np.asarray(at.tangent),
        scale=np.asarray(at.scale),
        step=float(here.step),
        arclength=float(here.arclength),
        iterations=int(at.iterations),
        converged=bool(converged),
        reason=reason,
        coefficient=coefficient,
        criticality=criticality,
        observed={k: np.asarray(v) for k, v in at.observed.items()},
        tests=dict(here.tests),
        signature=problem.signature,
        parameters=(*problem.free(z[:-1]), float(z[-1])),
        problem=with_parameter(problem, walk.leaf, z[-1]),
        leaf=walk.leaf,
    )
