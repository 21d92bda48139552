"""Follow many branches at once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import ArrayLike, Float, PyTree

from jaxcam.parameters import VectorLike, Where

from ._batch_run import Axes, BatchPlan, follow_lanes, REASONS
from ._context import Context
from ._follow import checked_bounds
from ._near_grazing import specials_between
from ._parameter import as_arguments, leaf_of, pick_one
from ._point import Branch, Point, set_parameters
from ._program import Corrected
from ._settings import as_traced, BranchSettings
from ._solution import point_of, Solution, solution_after, solution_at
from .algorithms import AbstractAlgorithm, PseudoArclength
from .problem import AbstractProblem


@dataclass(frozen=True, eq=False)
class Batch:
    """Branches in arrays of equal length; rows beyond the `count` of a branch are
    padding.
    """

    states: np.ndarray
    """States, shape `(branches, points, n)`."""
    parameters: np.ndarray
    """Parameter values, shape `(branches, points)`."""
    multipliers: np.ndarray
    """Eigenvalues or multipliers, shape `(branches, points, k)`."""
    count: np.ndarray
    """Number of points of each branch, shape `(branches,)`."""
    reasons: tuple[str, ...]
    """Reason why each branch ended, as one sentence."""
    name: str
    """Name of the parameter."""
    _passed: Corrected
    _problems: Callable[[int], AbstractProblem]
    _context: Context

    def lane(self, index: int) -> Branch:
        """Return one branch, with its special points located.

        Args:
            index: Index of the branch.

        Returns:
            A [`continuation.Branch`][].

        Raises:
            ValueError: There is no such branch, or it failed at the start.
        """
        if not 0 <= index < self.count.size:
            raise ValueError(
                f"there is no branch {index}; the indices run from 0 to "
                f"{self.count.size - 1}"
            )
        if self.count[index] == 0:
            raise ValueError(
                f"branch {index} has no points, as {self.reasons[index]}; start it "
                "elsewhere"
            )
        problem, context = self._problems(index), self._context
        rows = [
            jax.tree.map(lambda x: x[index, i], self._passed)
            for i in range(int(self.count[index]))
        ]
        points: list[Point] = []

        def add(here: Solution, kind: str, *details) -> None:
            points.append(point_of(context, here, len(points) + 1, kind, *details))

        current = solution_at(problem, context.leaf, rows[0], 0.0, 0.0)
        for i, at in enumerate(rows):
            if i > 0:
                before = current
                current = solution_after(before, context.leaf, at, 0.0)
                for special in specials_between(context, before, current):
                    located = special.located
                    add(
                        special.current, special.kind, located.reason,
                        located.converged, special.coefficient, special.criticality,
                    )  # fmt: skip
            last = i == len(rows) - 1
            kind = "start" if i == 0 else "end" if last else "regular"
            add(current, kind, self.reasons[index] if last else "")
        name, names = self.name, (self.name,)
        return Branch(tuple(points), name, context.bounds, context.leaf, names)


def _check_algorithm(algorithm: AbstractAlgorithm) -> None:
    if algorithm.predictor.stations > 1:
        raise ValueError(
            f"{type(algorithm.predictor).__name__} predicts from several points, which "
            "a batch does not keep; give the algorithm predictor=TangentPredictor()"
        )
    if algorithm.least_norm:
        raise ValueError(
            f"{type(algorithm).__name__} does not correct in a fixed plane, so a batch "
            "would not end on the bounds; use PseudoArclength()"
        )


def follow_batch(
    problem: AbstractProblem,
    states: Float[ArrayLike, "lanes n"] | Sequence[VectorLike],
    where: Where,
    bounds: tuple[float, float],
    algorithm: AbstractAlgorithm | None = None,
    *,
    parameters: PyTree | None = None,
    settings: BranchSettings | None = None,
    direction: ArrayLike = 1,
    points: int = 100,
    progress: Callable[[float], None] | None = None,
) -> Batch:
    """Follow many branches in one compiled program, each with its own step lengths.

    Branches differ in their starts, in the values of other parameters, or both.
    Features that need decisions in Python (transitions, admissibility and updated phase
    conditions) are not available.

    Args:
        problem: The problem.
        states: Initial states, shape `(branches, n)`, one row per branch.
        where: As for [`continuation.follow`][].
        bounds: As for [`continuation.follow`][].
        algorithm: Algorithm that corrects in a fixed hyperplane and predicts from a
            single point, for example along the tangent; default:
            [`continuation.PseudoArclength`][].
        parameters: Parameters of the problem; each float leaf has shape `(branches,)`
            or is a scalar for all branches. Default: those of the problem.
        settings: As for [`continuation.follow`][].
        direction: 1 or -1, or one of these for each branch, shape `(branches,)`.
        points: Maximum number of points on each branch.
        progress: Called with the fraction of points completed; a branch that has ended
            counts as complete.

    Returns:
        A `Batch`; its `reasons` state how each branch ended.

    Raises:
        ValueError: Shapes are inconsistent, or the algorithm cannot run in a batch.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> starts = [[1.0], [-1.0]]
        >>> batch = continuation.follow_batch(problem, starts, "a", (-1, 2), points=20)
        >>> batch.states.shape
        (2, 20, 1)
    """
    settings = BranchSettings() if settings is None else settings
    algorithm = PseudoArclength() if algorithm is None else algorithm
    _check_algorithm(algorithm)
    leaf, name = pick_one(where, problem.parameters)
    low, high = checked_bounds(bounds, name)
    starts = np.asarray(states, float)
    if starts.ndim != 2 or not len(starts):
        raise ValueError("states must have shape (branches, n), one row each")
    if points < 2:
        raise ValueError(f"points is {points}; a branch needs at least 2")
    lanes = len(starts)
    given = problem.parameters if parameters is None else parameters
    given = as_arguments(given, leaf)
    problem = set_parameters(problem, as_arguments(problem.parameters, leaf))
    axes = Axes.of(problem.parameters, given, lanes)
    p = np.broadcast_to(np.asarray(leaf_of(given, leaf), float), (lanes,))
    if not np.all((low <= p) & (p <= high)):
        raise ValueError(
            f"a branch starts outside the bounds ({low:g}, {high:g}) of {name}; widen "
            "them or start elsewhere"
        )
    z = np.concatenate([starts, p[:, None]], axis=1)
    signs = np.broadcast_to(np.asarray(direction, float), (lanes,))
    plan = BatchPlan(
        problem, algorithm, given, axes, leaf, np.asarray(low), np.asarray(high),
        as_traced(settings), points,
    )  # fmt: skip
    lane = follow_lanes(plan, z, signs, progress)
    lane = jax.tree.map(np.asarray, lane)
    passed = lane.passed
    matrices = passed.linearisation
    finite = np.all(np.isfinite(matrices), axis=(-1, -2), keepdims=True)
    multipliers = np.linalg.eigvals(np.where(finite, matrices, 0.0))
    multipliers = np.where(finite[..., 0], multipliers, np.nan)

    return Batch(
        states=passed.z[..., :-1],
        parameters=passed.z[..., -1],
        multipliers=multipliers,
        count=lane.count,
        reasons=tuple(REASONS[s] for s in lane.status),
        name=name,
        _passed=passed,
        _problems=lambda k: set_parameters(problem, axes.of_lane(given, k)),
        _context=Context(leaf, high - low, settings, (low, high)),
    )
