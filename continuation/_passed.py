"""Find special points between two points of a branch."""

from typing import NamedTuple

import numpy as np

from ._context import Context
from ._point import with_field, with_parameter
from ._program import evaluate
from ._solution import Solution, solution_after
from ._step import StepAttempt
from .special import (
    BRANCH_POINT,
    locate,
    Located,
    normal_form,
    pair_is_complex,
)


class Special(NamedTuple):
    """A special point: the solution, its kind, its location and its normal form."""

    current: Solution
    kind: str
    located: Located
    coefficient: float | None
    criticality: str


SHORT = 1e-2
"""Longest step around a corner or past a grazing, relative to the initial step."""
# distance from a special point at which the branch on either side of it is examined,
# relative to the length of the step
_NEAR = 1e-3


def _unknowns(problem, context: Context, z: np.ndarray):
    """Return the unknowns and the parameters at z = (u, parameter)."""
    return z[:-1], with_parameter(problem, context.leaf, z[-1]).parameters


def sign_changes(context: Context, current: Solution, following: Solution) -> list[str]:
    """Return the names of the test functions that change sign in the step."""
    if not context.settings.special:
        monitors = current.problem.monitors()
        watched = {k for k, monitor in monitors.items() if monitor.ends}
    else:
        watched = set(following.tests)
    found = []
    for name, after in following.tests.items():
        before = current.tests.get(name, 0.0)
        if name in watched and before * after < 0:
            found.append(name)
    # put branch points and corners first: discontinuous test functions change sign
    # there too
    first = {BRANCH_POINT, *corners(current, following)}
    return sorted(found, key=lambda name: name not in first)


def corners(current: Solution, following: Solution) -> list[str]:
    """Return the names of monitors that change sign in the step and may do so at a
    corner.
    """
    return [
        name
        for name, monitor in current.problem.monitors().items()
        if monitor.corner
        and current.tests.get(name, 0.0) * following.tests.get(name, 0.0) < 0
    ]


def around_corner(
    context: Context, current: Solution, attempted: StepAttempt, step: float
) -> StepAttempt:
    """Accept a step that turns abruptly if it is short and passes a corner."""
    short = SHORT * context.settings.step
    if attempted.solution is None or step > short:
        return attempted
    following = solution_after(current, context.leaf, attempted.solution, short)
    if not corners(current, following):
        return attempted
    return StepAttempt(attempted.solution, attempted.bound, short)


def located_between(
    context: Context, current: Solution, following: Solution, names: list[str]
) -> list[tuple[str, Located]]:
    """Return the zeros of these test functions, in the order in which they are passed.

    A common zero of two functions counts once, unless a monitor ends the branch there.
    If a change at a corner could not be located, other functions may have changed sign
    only because they jump there; those without a zero are omitted.
    """
    monitors = current.problem.monitors()
    turns = corners(current, following)
    found: list[tuple[float, str, Located]] = []
    for name in names:
        values = (current.tests[name], following.tests[name])
        located = locate(
            current.problem, name, context, current.at, following.at, values
        )
        way = (located.z - current.at.z) / current.at.scale
        same = [
            other
            for _, _, other in found
            if np.linalg.norm((located.z - other.z) / current.at.scale)
            < 1e-3 * np.linalg.norm((following.at.z - current.at.z) / current.at.scale)
            and other.converged
        ]
        if same and (name not in monitors or not monitors[name].ends):
            continue
        if not located.converged and (name in turns or name not in monitors):
            if any(n in turns and not other.converged for _, n, other in found):
                continue
        along = float(way @ (current.at.tangent / current.at.scale))
        found.append((along, name, located))
    found.sort(key=lambda item: item[0])
    return [(name, located) for _, name, located in found]


def special_here(
    context: Context, current: Solution, chord: np.ndarray, name: str, located: Located
) -> Special | None:
    """Return the special point at this zero of a test function; None if the zero is not
    a special point.

    `chord` points along the branch at the special point.
    """
    problem = current.problem
    at = evaluate(problem, context, located.z, chord)
    if not np.all(np.isfinite(at.tangent)) or name == BRANCH_POINT:
        at = with_field(at, "tangent", chord / np.linalg.norm(chord / at.scale))
    monitors, kind = problem.monitors(), name
    if name in monitors:
        ends = [located.z + share * chord for share in (-_NEAR, _NEAR)]
        if not located.converged:
            ends = [current.at.z, current.at.z + chord]
        sides = [_unknowns(problem, context, z) for z in ends]
        found = problem.kind_of_zero(name, *sides)
        if found is None:
            return None
        kind = found
    if located.converged and name not in monitors:
        if not pair_is_complex(problem, kind, context, located.z, at):
            return None
    coefficient, words = None, ""
    if name not in monitors and located.converged:
        coefficient, words = normal_form(kind, problem, context, located.z, at)
    length = float(np.linalg.norm((located.z - current.at.z) / current.at.scale))
    following = Solution(problem, at, {}, current.step, current.arclength + length, ())
    return Special(following, kind, located, coefficient, words)
