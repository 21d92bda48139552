"""Cascades of flips."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from jaxcam.parameters import Where

from ._follow import checked_bounds, follow
from ._parameter import pick_one
from ._point import Branch, Point, with_field
from ._settings import BranchSettings
from ._switch import emanating
from .algorithms import AbstractAlgorithm
from .problem import AbstractProblem, Start
from .special import FLIP


# ordinary points that a branch of the cascade gets at least, if its length shrinks
# no faster than the square of Feigenbaum's 2.5029
_POINTS = 10


@dataclass(frozen=True, eq=False)
class Cascade:
    """Branches of doubled orbits, each up to its first flip."""

    branches: tuple[Branch, ...]

    @property
    def flips(self) -> tuple[Point, ...]:
        """The flip at the end of each branch."""
        return tuple(b.points[-1] for b in self.branches if b.points[-1].kind == FLIP)

    @property
    def parameters(self) -> np.ndarray:
        """Parameter values of the flips."""
        return np.array([point.parameter for point in self.flips])

    @property
    def ratios(self) -> np.ndarray:
        """(flips - 2,) quotients of successive distances, (2.17)."""
        gaps = np.diff(self.parameters)
        return gaps[:-1] / gaps[1:]

    @property
    def reason(self) -> str:
        """Why the cascade ends."""
        return self.branches[-1].reason


def cascade(
    problem: AbstractProblem,
    start: Any,
    where: Where,
    bounds: tuple[float, float],
    algorithm: AbstractAlgorithm | None = None,
    *,
    flips: int = 6,
    settings: BranchSettings | None = None,
    direction: int = 1,
    callbacks: Iterable[Callable[[Point], Any]] = (),
) -> Cascade:
    """Follow a branch to its flip, the doubled branch to its own, and so on.

    **Arguments:** as of [`continuation.follow`][], and `flips`: how many to locate;
    `callbacks`, called with each point as it comes, to show progress. Steps shrink with
    the lengths of the branches.

    Returns:
        A `Cascade`; it has fewer flips where a branch ends without one, and then its
            `reason` says why.
    """
    if flips < 1:
        raise ValueError(f"flips is {flips}; give the number of flips, at least 1")
    walk: Any = BranchSettings() if settings is None else settings
    begun = start.problem if isinstance(start, Start) else problem
    leaf, name = pick_one(where, begun.parameters)
    bounds = checked_bounds(bounds, name)
    branches, seen = [], tuple(callbacks)
    while len(branches) < flips:
        points = []
        for point in follow(
            problem, start, where, bounds, algorithm,
            settings=walk, direction=direction,
        ):  # fmt: skip
            points.append(point)
            for callback in seen:
                callback(point)
            if point.kind == FLIP and point.converged:
                break
        branches.append(Branch(tuple(points), name, bounds, leaf, (name,)))
        last = points[-1]
        if last.kind != FLIP or len(branches) == flips:
            break
        (start,) = emanating(last, where, bounds[1] - bounds[0])
        problem = start.problem
        # doubled branches are shorter, in state by about 2.5, in parameter by 4.7
        longest = last.arclength / 2.5 / _POINTS if len(branches) > 1 else np.inf
        longest = max(min(walk.max_step, longest), 4 * walk.min_step)
        first = min(walk.step, longest / 4)
        walk = with_field(with_field(walk, "max_step", longest), "step", first)
    return Cascade(tuple(branches))
