"""Period-doubling cascades."""

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


# minimum number of regular points on a branch of the cascade, if it is shorter than the
# branch before by the factor 2.5 (Feigenbaum's constant of the state)
_POINTS = 10


@dataclass(frozen=True, eq=False)
class Cascade:
    """Branches of successively period-doubled orbits, each up to its first flip."""

    branches: tuple[Branch, ...]
    """The branches, in order of doubling."""

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
        """Ratios of successive distances between flips, shape `(flips - 2,)` (thesis,
        eq. 2.17).
        """
        gaps = np.diff(self.parameters)
        return gaps[:-1] / gaps[1:]

    @property
    def reason(self) -> str:
        """The reason the cascade ends."""
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
    progress: Callable[[float], None] | None = None,
) -> Cascade:
    """Follow a branch to its flip, the period-doubled branch to its flip, and so on.

    Step lengths decrease with the lengths of the branches.

    Args:
        problem: The problem.
        start: As for [`continuation.follow`][].
        where: Selects the parameter.
        bounds: (lowest, highest) value of the parameter.
        algorithm: The algorithm; default: [`continuation.PseudoArclength`][].
        flips: Number of flips to locate.
        settings: Accuracy and step control.
        callbacks: Called with each point as it is found.
        progress: Called after each branch with the fraction of `flips` located, and
            with 1 at the end.
        direction: 1 to start towards larger parameters, -1 towards smaller ones.

    Returns:
        A `Cascade`. If a branch ends without a flip, there are fewer flips, and
            `reason` explains why.

    Raises:
        ValueError: As for [`continuation.follow`][].

    Examples:
        >>> import continuation
        >>> f = lambda u, p: p["a"] * u * (1 - u)
        >>> logistic = continuation.FixedPoint(f, {"a": 2.0})
        >>> found = continuation.cascade(logistic, [0.5], "a", (1.5, 4.0), flips=2)
        >>> found.parameters.round(4).tolist()
        [3.0, 3.4495]
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
        if progress is not None and len(branches) < flips:
            progress(len(branches) / flips)
        last = points[-1]
        if last.kind != FLIP or len(branches) == flips:
            break
        (start,) = emanating(last, where, bounds[1] - bounds[0])
        problem = start.problem
        # each period-doubled branch is shorter than the one before, by a factor of
        # about 2.5 in the state and 4.7 in the parameter
        longest = last.arclength / 2.5 / _POINTS if len(branches) > 1 else np.inf
        longest = max(min(walk.max_step, longest), 4 * walk.min_step)
        first = min(walk.step, longest / 4)
        walk = with_field(with_field(walk, "max_step", longest), "step", first)
    if progress is not None:
        progress(1.0)
    return Cascade(tuple(branches))
