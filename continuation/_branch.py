"""Follow complete branches."""

import dataclasses
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from jaxcam.parameters import Where

from ._follow import checked_bounds, follow
from ._parameter import pick_one
from ._point import Branch, Point, relabelled, replace
from ._record import header_of, read_branch, Recorder
from ._settings import BranchSettings
from ._stated import stated
from .algorithms import AbstractAlgorithm, PseudoArclength
from .problem import AbstractProblem, Start


def branch(
    problem: Any,
    start: Any,
    where: Where,
    bounds: tuple[float, float],
    algorithm: AbstractAlgorithm | None = None,
    *,
    settings: BranchSettings | None = None,
    direction: int | str = 1,
    callbacks: Iterable[Callable[[Point], Any]] = (),
    progress: Callable[[float], None] | None = None,
    out: str | os.PathLike | None = None,
    resume: bool = False,
) -> Branch:
    """Follow a branch of solutions to its end and return it.

    [`continuation.follow`][] describes the common arguments in more detail.

    Args:
        problem: The problem, or a hybrid system with one of its orbits as `start`.
        start: A state `(n,)`, a [`continuation.Start`][] or a [`continuation.Point`][].
        where: Selects the parameter, as in `lambda parameters: parameters.speed`.
        bounds: (lowest, highest) value of the parameter; the branch ends exactly there.
        algorithm: The algorithm; default: [`continuation.PseudoArclength`][].
        settings: Accuracy and step control.
        direction: 1 or -1; or `"both"`, in which case the parts towards smaller and
            larger parameter values are joined in order and relabelled.
        callbacks: Called with each point as it is found, for example to save it. If a
            callback returns True, the branch ends.
        progress: Called after each point with the fraction of `settings.max_points`
            computed, and with 1 at the end. Most branches end earlier, at a bound.
        out: A file to which each point is appended, for [`continuation.load_branch`][];
            for `"both"`, the part towards smaller values has its own `.back` file.
        resume: Whether to continue an interrupted call from the points in `out`. The
            result is identical to that of an uninterrupted call.

    Returns:
        A [`continuation.Branch`][].

    Raises:
        ValueError: As for [`continuation.follow`][].

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> [point.kind for point in found.special]
        ['fold']
    """
    if direction not in (1, -1, "both"):
        raise ValueError(f"direction is {direction!r}; give 1, -1 or 'both'")
    stop = tuple(callbacks)
    problem, start = stated(problem, start)
    begun = start.problem if isinstance(start, Start) else problem
    leaf, name = pick_one(where, begun.parameters)
    empty = Branch((), name, checked_bounds(bounds, name), leaf, (name,))
    # the start and the end of each part are counted, too
    most = (2 + (settings or BranchSettings()).max_points) * (1 + (direction == "both"))

    def walk(direction: int, path: Path | None, done: float = 0.0) -> list[Point]:
        points, save, begin = [], None, start
        if path is not None:
            header = header_of(
                empty,
                direction=direction,
                algorithm=str(algorithm or PseudoArclength()),
                settings=str(settings or BranchSettings()),
            )
            if resume and path.exists():
                points = _written(path, header, begun)
                if points and points[-1].kind == "end":
                    return points
                begin = points[-1] if points else start
            save = Recorder(path, header, tuple(points))
        for point in follow(
            problem, begin, where, bounds, algorithm,
            settings=settings, direction=direction, history=tuple(points),
        ):  # fmt: skip
            points.append(point)
            if save is not None:
                save(point)
            if progress is not None and not point.special:
                ordinary = sum(not one.special for one in points)
                progress(done + ordinary / most)
            # call every callback, even if one of them ends the branch
            if any([callback(point) is True for callback in stop]):
                break
        return points

    path = None if out is None else Path(out)
    if direction == "both":
        back_path = None if path is None else path.with_suffix(".back" + path.suffix)
        back, forth = walk(-1, back_path), walk(1, path, 0.5)
        points = _joined(back, forth)
    else:
        assert isinstance(direction, int)
        points = tuple(walk(direction, path))
    if progress is not None:
        progress(1.0)
    return dataclasses.replace(empty, points=points)


def _joined(back: list[Point], forth: list[Point]) -> tuple[Point, ...]:
    """Return the points of both directions in order."""
    if back[-1].reason.startswith("the branch is closed"):
        return tuple(back)
    turned = [
        replace(
            point,
            tangent=-point.tangent,
            arclength=-point.arclength,
            kind="regular" if point.kind == "start" else point.kind,
        )
        for point in reversed(back)
    ]
    return relabelled([*turned, *forth[1:]])


def _written(path: Path, header: dict, problem: AbstractProblem) -> list[Point]:
    """Return the points of an interrupted run, up to the last regular point."""
    branch, before = read_branch(path, problem)
    different = [key for key, value in header.items() if before.get(key) != value]
    if different:
        raise ValueError(
            f"{path} was written with different {', '.join(different)}; resume with "
            "the same, or write to another file"
        )
    points = list(branch.points)
    # special points after the last point at which a step begins are found again
    while points and (points[-1].special or points[-1].step == 0):
        points.pop()
    return points
