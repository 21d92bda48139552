"""Curves of special points in two parameters."""

import os
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from jaxcam.parameters import Where

from ._branch import branch
from ._context import Context
from ._follow import checked_bounds
from ._parameter import as_arguments, leaf_of, pick_one
from ._point import Branch, Point, set_parameters
from ._program import evaluate
from ._settings import BranchSettings
from .algorithms import AbstractAlgorithm
from .problem import Start
from .special import (
    FLIP,
    FOLD,
    HOPF,
    MonitorPoints,
    NEIMARK_SACKER,
    singular_points,
    SingularPoints,
)


# `parameters` is a property, but type checkers take it for a constructor argument
_monitored: Any = MonitorPoints
# a monitor below this, relative to one plus the largest unknown, counts as zero
_ZERO = 1e-7


def extended(
    point: Point,
    where: Where,
    bounds: tuple[float, float],
    settings: BranchSettings | None = None,
) -> SingularPoints | MonitorPoints:
    """Return the problem whose solutions are special points like this one; the
    parameter selected by `where` is one of its unknowns (at the end of the state).

    Raises:
        ValueError: Points of this kind do not form a curve.
    """
    problem = point.solved
    leaf, name = pick_one(where, problem.parameters)
    low, high = checked_bounds(bounds, name)
    problem = set_parameters(problem, as_arguments(problem.parameters, leaf))
    context = Context(leaf, high - low, settings or BranchSettings(), (low, high))
    z = np.append(point.state, leaf_of(problem.parameters, leaf))
    if point.kind in (FOLD, FLIP, HOPF, NEIMARK_SACKER):
        return singular_points(problem, point.kind, context, z)
    same = [
        k for k, monitor in problem.monitors().items() if monitor.kind == point.kind
    ]
    if len(same) > 1:
        # several monitors may have the same kind: choose the one that is zero here; if
        # several are zero, such as the speed of a grazing impact and the gap of the
        # flight next to it, choose the last
        at = evaluate(problem, context, z, np.ones_like(z))
        sizes = {k: abs(float(at.monitors[k])) for k in same}
        most = max(min(sizes.values()), _ZERO * (1.0 + float(np.max(np.abs(z)))))
        same = [k for k in same if sizes[k] <= most]
    if same:
        return _monitored(
            problem,
            same[-1],
            leaf,
            np.asarray(context.width),
            np.asarray(context.bounds),
        )
    raise ValueError(
        f"points of kind {point.kind!r} do not form a curve in two parameters; folds, "
        "flips, Neimark-Sacker and Hopf points and the zeros of a problem's monitors do"
    )


def curve(
    point: Point,
    where: tuple[Callable[[Any], Any], Callable[[Any], Any]],
    bounds: tuple[tuple[float, float], tuple[float, float]],
    algorithm: AbstractAlgorithm | None = None,
    *,
    settings: BranchSettings | None = None,
    direction: int | str = "both",
    callbacks: Iterable[Callable[[Point], Any]] = (),
    progress: Callable[[float], None] | None = None,
    out: str | os.PathLike | None = None,
    resume: bool = False,
) -> Branch:
    """Follow a special point in two parameters.

    Args:
        point: A fold, flip, Neimark-Sacker or Hopf point of a branch, or a zero of a
            monitor of its problem.
        where: Selects the two parameters. The first becomes an unknown; step lengths
            and `point.parameter` refer to the second.
        bounds: (lowest, highest) value of each parameter; the curve ends exactly on
            these bounds.
        algorithm: The algorithm; default: [`continuation.PseudoArclength`][].
        settings: Accuracy and step control.
        direction: As for [`continuation.branch`][].
        callbacks: As for [`continuation.branch`][].
        progress: As for [`continuation.branch`][].
        out: As for [`continuation.branch`][].
        resume: As for [`continuation.branch`][].

    Returns:
        A [`continuation.Branch`][]; `point.parameters` contains both parameters in the
            order of `where`. Its special points are those of codimension two (cusp,
            Bogdanov-Takens, zero-Hopf; generalized flip, fold-flip; 1:1, 1:2, 1:3, 1:4
            resonances) and zeros of monitors.

    Raises:
        ValueError: Points of this kind do not form a curve; or as for
            [`continuation.follow`][].

    Examples:
        >>> import continuation
        >>> field = lambda u, p: p["a"] + p["b"] * u + u**3
        >>> problem = continuation.Equilibrium(field, {"a": 2.0, "b": -1.0})
        >>> found = continuation.branch(problem, [-1.52], "a", (-2, 2.5), direction=-1)
        >>> where = lambda p: p["a"], lambda p: p["b"]
        >>> curve = continuation.curve(found.special[0], where, ((-2, 2.5), (-2, 1)))
        >>> "cusp" in [point.kind for point in curve.special]
        True
    """
    try:
        (first, second), (bounds_1, bounds_2) = where, bounds
    except (TypeError, ValueError) as error:
        raise ValueError(
            "give two parameters, where=(lambda p: p.a, lambda p: p.b), and bounds "
            "of both, ((low, high), (low, high))"
        ) from error
    problem = extended(point, first, bounds_1, settings)
    leaf, name = pick_one(second, problem.parameters)
    if leaf == problem.leaf:
        raise ValueError(f"both parameters are {name}; choose two different ones")
    u = np.append(point.state, leaf_of(problem.parameters, problem.leaf))
    found = branch(
        problem, Start(problem, u), second, bounds_2, algorithm,
        settings=settings, direction=direction, callbacks=callbacks,
        progress=progress, out=out, resume=resume,
    )  # fmt: skip
    names = (pick_one(first, problem.parameters)[1], name)
    return Branch(found.points, name, found.bounds, found.leaf, names)
