"""Follow a branch point by point."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from jaxcam.parameters import real_array, Where

from ._context import Context
from ._parameter import as_arguments, pick_one
from ._point import Point, set_parameters
from ._run import Run
from ._settings import BranchSettings
from ._stated import stated
from .algorithms import AbstractAlgorithm, PseudoArclength
from .problem import AbstractProblem, Start


def follow(
    problem: Any,
    start: Any,
    where: Where,
    bounds: tuple[float, float],
    algorithm: AbstractAlgorithm | None = None,
    *,
    settings: BranchSettings | None = None,
    direction: int = 1,
    history: Sequence[Point] = (),
) -> Iterator[Point]:
    """Follow a branch of solutions and yield its points, including special points.

    The branch ends at a bound, at a return to one of its earlier points, where
    period-doubled orbits join those of half the period, or at the zero of a monitor
    that ends the problem, unless there is a transition to another problem. It also ends
    if the smallest step fails, and after `settings.max_points` points. The `reason` of
    the last point states the cause.

    Args:
        problem: The problem, such as [`continuation.Equilibrium`][]; or a hybrid
            system, with one of its orbits as `start`.
        start: A state `(n,)` at the parameter value of the problem, on the branch or
            close enough for Newton's method to converge; or a [`continuation.Start`][],
            such as the start of a branch to switch to; or a [`continuation.Point`][],
            from which the branch continues exactly as it did originally.
        where: Selects the parameter, as in `lambda parameters: parameters.speed`.
        bounds: (lowest, highest) value of the parameter; the branch ends exactly there.
        algorithm: The algorithm; default: [`continuation.PseudoArclength`][].
        settings: Accuracy and step control.
        direction: 1 to start towards larger parameters, -1 towards smaller ones.
        history: The points before `start`, if `start` is a [`continuation.Point`][].
            Predictors that use several points need them, and so does the detection of
            accumulations.

    Returns:
        An iterator of [`continuation.Point`][].

    Raises:
        ValueError: The start is not a solution, the parameter does not exist, or the
            bounds are reversed or do not contain the start.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> points = continuation.follow(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> next(points).kind
        'start'
    """
    settings = BranchSettings() if settings is None else settings
    algorithm = PseudoArclength() if algorithm is None else algorithm
    begun, at = _begun(*stated(problem, start))
    leaf, name = pick_one(where, begun.parameters)
    begun = set_parameters(begun, as_arguments(begun.parameters, leaf))
    low, high = checked_bounds(bounds, name)
    if direction not in (1, -1):
        raise ValueError(f"direction is {direction!r}; give 1 or -1")
    context = Context(leaf, high - low, settings, (low, high))
    run = Run(context, algorithm, name, direction)
    # the first point is computed now, so that invalid input is reported here
    first = run.begin(begun, at, history)
    return run.points(first)


def checked_bounds(bounds: tuple[float, float], name: str) -> tuple[float, float]:
    """Return bounds as floats, or raise a `ValueError` with the reason."""
    try:
        low, high = (float(x) for x in bounds)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"bounds of {name} must be two numbers, (lowest, highest)"
        ) from error
    if not (np.isfinite(low) and np.isfinite(high)):
        raise ValueError(f"bounds of {name} must be finite, not ({low:g}, {high:g})")
    if low >= high:
        raise ValueError(
            f"bounds ({low:g}, {high:g}) of {name} are reversed; give (lowest, highest)"
        )
    return low, high


def _begun(problem: AbstractProblem, start: Any) -> tuple[AbstractProblem, Any]:
    """Return the problem with which the branch starts, and its start."""
    if isinstance(start, Start):
        return start.problem, start
    if isinstance(start, Point):
        if start.signature != problem.signature:
            problem = problem.with_signature(start.signature)
        return problem, start
    state = np.asarray(real_array(start, "start"))
    if state.ndim == 0:
        state = state[None]
    if state.ndim != 1 or not np.all(np.isfinite(state)):
        raise ValueError("start must be a state of shape (n,) of finite numbers")
    return problem, Start(problem, state)
