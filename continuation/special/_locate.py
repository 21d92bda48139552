"""Locate special points between two points of a branch."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import root_scalar

from .._context import Context
from .._program import correct, Corrected, solve
from ..problem import AbstractProblem
from ._bialternate import determinant_on_plane, trace_on_plane
from ._branch_points import differenced_crossing, solved_crossing
from ._monitor_points import monitor_level
from ._normal_forms import null_vectors
from ._singular_points import matrix_at, SingularPoints
from ._test_functions import (
    BRANCH_POINT,
    HOPF,
    NEIMARK_SACKER,
    test_values,
)


# `parameters` is a property, but type checkers take it for a constructor argument
_singular: Any = SingularPoints


# a monitor jumps if, at its located zero, it exceeds this fraction of nearby values
_JUMP = 1e-6


class Located(NamedTuple):
    """The result of locating a special point, with a reason if that failed."""

    z: np.ndarray
    converged: bool
    reason: str


def singular_points(
    problem: AbstractProblem, kind: str, context: Context, z: np.ndarray
) -> SingularPoints:
    """Return the extended problem for a kind of special point, with border vectors
    computed at z, a point near the special point.
    """
    m = matrix_at(problem, kind, context.leaf, z)
    border = np.zeros(m.shape[0])
    empty = _singular(
        problem,
        kind,
        context.leaf,
        np.asarray(context.width),
        np.asarray(context.bounds),
        border,
        border,
    )
    return empty.refreshed(np.asarray(z), problem.parameters)


def _newton(problem, name: str, context: Context, guess: np.ndarray):
    """Apply Newton's method to the extended system; return (z, success)."""
    if name == BRANCH_POINT:
        return solved_crossing(problem, context, guess)
    if name in problem.monitors():
        extended = monitor_level(problem, name, context)
    else:
        extended = singular_points(problem, name, context, guess)
    value, success, _ = solve(extended, guess, context.settings)
    return value, success


def locate(
    problem: AbstractProblem,
    name: str,
    context: Context,
    a: Corrected,
    b: Corrected,
    values: tuple[float, float],
) -> Located:
    """Locate the zero of a test function between points a and b of a branch.

    Newton's method is applied to the extended system, starting from the secant
    estimate. If it fails or leaves the bracket, the bracket is first reduced with
    points of the branch.
    """
    monitor = problem.monitors().get(name)
    automatic = context.settings.localise != "newton"
    if monitor is not None and problem.costly and not monitor.bracket and automatic:
        # compiling the extended system would take longer than a few more points
        z = _on_the_way(problem, name, context, a, b, values)
        if z is not None:
            return Located(z, True, "")
    low, high = (a.z, values[0]), (b.z, values[1])
    guess = cubic_between(a, b, values[0] / (values[0] - values[1]))
    choice = context.settings.localise
    newton = choice == "newton" or (choice == "auto" and not problem.costly)
    if monitor is not None:
        newton = newton and not monitor.bracket
    direct = newton or (monitor is not None and not monitor.bracket)
    for attempt in range(60):
        if direct:
            z, success = _newton(problem, name, context, guess)
            if success and _inside(z, low[0], high[0], a.scale):
                return Located(z, True, "")
        direct = newton and attempt < 12
        chord = (high[0] - low[0]) / a.scale
        length = float(np.linalg.norm(chord))
        if length < context.settings.tolerance:
            break
        guess = _next_guess(low, high, attempt)
        middle = correct(problem, context, guess, chord / a.scale, a.tangent)
        if not middle.success or not _inside(middle.z, low[0], high[0], a.scale):
            if name == BRANCH_POINT:
                # close to it, the equations are singular, so the corrector fails
                return _between_branches(problem, context, a, b, guess)
            reason = "the branch could not be computed between two of its points"
            return Located(guess, False, reason)
        value = test_values(problem, context.leaf, middle)[name]
        if value == 0:
            return Located(middle.z, True, "")
        if np.sign(value) == np.sign(low[1]):
            low = (middle.z, value)
        else:
            high = (middle.z, value)
        guess = middle.z
    if length < context.settings.tolerance:
        if name == BRANCH_POINT:
            return _between_branches(problem, context, a, b, guess)
        return Located(guess, True, "")
    return Located(
        guess, False, "Newton's method on the extended system did not converge"
    )


def _on_the_way(
    problem: AbstractProblem,
    name: str,
    context: Context,
    a: Corrected,
    b: Corrected,
    values: tuple[float, float],
) -> np.ndarray | None:
    """Return the zero of a monitor on the branch from a to b by Brent's method, or None
    if a point between them could not be computed, or if the monitor jumps.
    """
    chord = (b.z - a.z) / a.scale
    points: list[np.ndarray] = []

    def value(share: float) -> float:
        if share in (0.0, 1.0):
            return values[int(share)]
        guess = cubic_between(a, b, share)
        at = correct(problem, context, guess, chord / a.scale, a.tangent)
        if not at.success or not _inside(at.z, a.z, b.z, a.scale):
            raise ArithmeticError
        points.append(at.z)
        return float(test_values(problem, context.leaf, at)[name])

    try:
        found = root_scalar(value, bracket=(0.0, 1.0), method="brentq", xtol=1e-15)
        rest = value(found.root)
    except (ArithmeticError, ValueError, RuntimeError):
        return None
    jumps = abs(rest) > _JUMP * max(map(abs, values))
    return None if jumps or not points else points[-1]


def _between_branches(
    problem: AbstractProblem,
    context: Context,
    a: Corrected,
    b: Corrected,
    guess: np.ndarray,
) -> Located:
    """Return the branch point near `guess`, where bracketing ended."""
    z, success = differenced_crossing(problem, context, guess)
    if success and _inside(z, a.z, b.z, a.scale):
        return Located(z, True, "")
    return Located(
        guess,
        False,
        "the determinant changes sign between two points of the branch, but the "
        "equations of a branch point have no solution there",
    )


def _next_guess(low, high, attempt: int) -> np.ndarray:
    """Return a secant estimate in the bracket, or its middle in every third attempt."""
    share = 0.5
    if attempt % 3 != 2:
        share = abs(low[1]) / (abs(low[1]) + abs(high[1]))
        share = min(max(share, 0.01), 0.99)
    return low[0] + share * (high[0] - low[0])


def cubic_between(a: Corrected, b: Corrected, share: float) -> np.ndarray:
    """Return a point on the cubic through two points and their tangents."""
    if not np.isfinite(share):
        share = 0.5
    chord = b.z - a.z
    length = np.linalg.norm(chord / a.scale)
    s = share
    return (
        a.z * (1 + 2 * s) * (1 - s) ** 2
        + b.z * s * s * (3 - 2 * s)
        + length * a.tangent * s * (1 - s) ** 2
        + length * b.tangent * s * s * (s - 1)
    )


def _inside(z, low, high, scale, slack: float = 1e-6) -> bool:
    """Return whether z lies between the ends, and near the chord."""
    chord, way = (high - low) / scale, (z - low) / scale
    length = np.linalg.norm(chord)
    along = float(way @ chord) / length
    aside = float(np.linalg.norm(way - along / length * chord))
    edge = slack * length + 1e-9
    return bool(-edge <= along <= length + edge and aside <= length)


def ahead(
    problem: AbstractProblem, name: str, context: Context, a: Corrected, value: float,
    reach: float,
) -> Located | None:  # fmt: skip
    """Find the zero of a monitor within `reach` ahead of a point of the branch, if any.

    This function is for monitors that do not change sign or that end the branch: the
    solution may not exist at or beyond the zero. The zero is therefore approached from
    this side, level by level.
    """
    z, level, failures = a.z, value, 0

    def reached(target: float):
        extended = monitor_level(problem, name, context, target)
        found, success, _ = solve(extended, z, context.settings)
        way = (found - a.z) / a.scale
        forward = float(way @ (a.tangent / a.scale)) > 0
        near = success and forward and float(np.linalg.norm(way)) <= reach
        return found, success, near

    while failures < 4:
        found, _, near = reached(0.0)
        if near:
            return Located(found, True, "")
        target = level * (0.1 if failures == 0 else 0.5)
        found, success, near = reached(target)
        if near:
            # the remaining distance to the zero, by linear extrapolation
            rest = target / (level - target) * (found - z)
            z, level = found, target
            if float(np.linalg.norm(rest / a.scale)) <= context.settings.tolerance:
                return Located(z + rest, True, "")
        elif success:
            return None
        else:
            failures += 1
    return None


def pair_is_complex(problem, kind: str, context: Context, z: np.ndarray, at) -> bool:
    """Return whether a critical pair of eigenvalues is complex; if it is real, the
    point is a neutral saddle. Points of other kinds need no pair: return True.
    """
    if kind not in (HOPF, NEIMARK_SACKER):
        return True
    right, _ = null_vectors(matrix_at(problem, kind, context.leaf, z))
    a, w = jnp.asarray(at.linearisation), jnp.asarray(right)
    if kind == HOPF:
        return float(determinant_on_plane(a, w)) > 0
    return abs(float(trace_on_plane(a, w))) < 2
