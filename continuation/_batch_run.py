"""Take the steps of many branches in one compiled program."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxcam.hybrid.programs import program

from ._point import set_parameters, with_field
from ._program import correct_, Corrected
from ._settings import BranchSettings
from .algorithms import AbstractAlgorithm
from .predictors import Station
from .problem import AbstractProblem
from .step_control import measure_step


_RUNNING, _BOUND, _SHORT, _FULL, _NO_START = range(5)
# maximum number of attempted steps per call of `_advance`, with and without progress
# reports
_ROUNDS, _WHOLE = 16, np.iinfo(np.int64).max
REASONS = (
    "running",
    "the parameter is at its bound",
    "the step was halved down to the smallest, and the corrector still failed or the "
    "branch turned too sharply",
    "the requested number of points was reached",
    "the start is not a solution, and Newton's method finds none near it",
)


class Lane(NamedTuple):
    """The state of one branch of the batch during the run."""

    at: Corrected
    step: jax.Array
    count: jax.Array
    status: jax.Array
    passed: Corrected


class Axes(eqx.Module):
    """A static record of which parameters differ between branches."""

    tree: PyTree = eqx.field(static=True)
    """For each leaf of the parameters, 0 (the axis of the branches) if its value
    differs between branches, otherwise None.
    """

    @staticmethod
    def of(one: PyTree, given: PyTree, lanes: int) -> "Axes":
        """Return the record for `given`, the parameters of all branches; `one` contains
        the parameters of a single branch.

        Raises:
            ValueError: The number of values of a leaf is not the number of branches.
        """
        axes = jax.tree.map(
            lambda a, b: 0 if np.ndim(b) == np.ndim(a) + 1 else None, one, given
        )
        found = Axes(axes)
        for axis, many in zip(found.leaves, jax.tree.leaves(given), strict=True):
            if axis == 0 and len(many) != lanes:
                raise ValueError(
                    f"a parameter has {len(many)} values for {lanes} branches; give "
                    "one for each, or one for all"
                )
        return found

    @property
    def leaves(self) -> list:
        """Return 0 or None for each leaf of the parameters, in order."""
        return jax.tree.leaves(self.tree, is_leaf=lambda x: x is None)

    def of_lane(self, given: PyTree, index: int) -> PyTree:
        """Return the parameters of one branch, given those of all branches."""
        flat, structure = jax.tree.flatten(given)
        chosen = [
            x[index] if axis == 0 else x
            for x, axis in zip(flat, self.leaves, strict=True)
        ]
        return jax.tree.unflatten(structure, chosen)


class BatchPlan(eqx.Module):
    """What a run of many branches needs and does not change."""

    problem: AbstractProblem
    """The problem."""
    algorithm: AbstractAlgorithm
    """An algorithm that predicts from one point."""
    parameters: PyTree
    """Parameters of all branches."""
    axes: Axes
    """Which of these differ between branches."""
    leaf: int
    """Index of the parameter that is continued."""
    low: np.ndarray
    """Lower bound of this parameter."""
    high: np.ndarray
    """Upper bound of this parameter."""
    settings: BranchSettings
    """Settings from `as_traced`."""
    points: int
    """Maximum number of points on each branch."""

    def at(self, parameters: PyTree) -> AbstractProblem:
        """Return the problem of one branch, given its parameters."""
        return set_parameters(self.problem, parameters)

    def mapped(self, function: Callable, *others):
        """Return `function` of the parameters of each branch and of the `others`, whose
        leading axis is that of the branches.
        """
        axes = (self.axes.tree, *(0 for _ in others))
        return jax.vmap(function, in_axes=axes)(self.parameters, *others)


def follow_lanes(
    plan: BatchPlan, starts, signs, progress: Callable[[float], None] | None
) -> Lane:
    """Follow all branches to their ends.

    **Arguments:** for each branch, a point (state, parameter) to start from and the
    sign of its direction; and `progress`, which is called with the completed fraction,
    or None.

    Returns:
        The final `Lane` of each branch.
    """
    lanes = _begin(plan, starts, signs)
    rounds = np.asarray(_WHOLE if progress is None else _ROUNDS)
    while np.any(lanes.status == _RUNNING):
        lanes = _advance(plan, lanes, rounds)
        if progress is not None:
            # a branch that has ended counts as complete
            running = lanes.status == _RUNNING
            done = np.where(running, lanes.count / plan.points, 1.0)
            progress(float(np.mean(done)))
    return lanes


@program
def _begin(plan: BatchPlan, starts, signs):
    """Return the `Lane` of each branch at its first point."""
    settings = plan.settings
    width = plan.high - plan.low

    def begin(parameters, start, sign):
        across = jnp.zeros_like(start).at[-1].set(1.0)
        at = correct_(
            plan.at(parameters), plan.leaf, start, across, across, width,
            settings.tolerance, 30, False,
        )  # fmt: skip
        turn = jnp.where(at.tangent[-1] * sign < 0, -1.0, 1.0)
        tangent = turn * at.tangent
        at = with_field(at, "tangent", tangent)
        # the determinant of the Jacobian bordered by the tangent changes sign with it
        at = with_field(at, "determinant", turn * at.determinant)
        buffer = jax.tree.map(
            lambda x: jnp.zeros((plan.points, *x.shape), x.dtype).at[0].set(x), at
        )
        good = at.success & jnp.all(jnp.isfinite(tangent))
        return Lane(
            at=at,
            step=jnp.asarray(settings.step),
            count=jnp.where(good, 1, 0),
            status=jnp.where(good, _RUNNING, _NO_START),
            passed=buffer,
        )

    return plan.mapped(begin, starts, signs)


@program
def _advance(plan: BatchPlan, lanes: Lane, rounds):
    """Attempt up to `rounds` steps on each branch that has not ended."""
    low, high, settings = plan.low, plan.high, plan.settings
    width = high - low

    def advance(parameters, lane: Lane) -> Lane:
        a, control = lane.at, plan.algorithm.control
        tangent = a.tangent / a.scale / jnp.linalg.norm(a.tangent / a.scale)
        stations = [Station(a.z / a.scale, tangent)]
        change = plan.algorithm.predictor(stations, lane.step) * a.scale - a.z
        target = a.z[-1] + change[-1]
        bound = jnp.where(change[-1] > 0, high, low)
        lands = (target > high) | (target < low)
        share = jnp.where(lands, (bound - a.z[-1]) / change[-1], 1.0)
        guess = a.z + share * change
        guess = guess.at[-1].set(jnp.where(lands, bound, guess[-1]))
        across = jnp.zeros_like(a.z).at[-1].set(1.0 / width)
        normal = jnp.where(lands, across, plan.algorithm.normal(tangent) / a.scale)
        b = correct_(
            plan.at(parameters), plan.leaf, guess, normal, a.tangent, width,
            settings.tolerance, settings.max_iterations, False,
        )  # fmt: skip
        z = b.z.at[-1].set(jnp.where(lands, bound, b.z[-1]))
        b = with_field(b, "z", z)
        measures = measure_step(a, b, guess)
        refused = list(control.refusals(measures, lane.step, settings).values())
        inside = (low <= z[-1]) & (z[-1] <= high)
        finite = jnp.all(jnp.isfinite(b.tangent))
        good = b.success & finite & inside & ~jnp.any(jnp.stack(refused))
        following = control.next_step(measures, lane.step, settings)
        step = jnp.where(good, following, lane.step / 2)
        count = lane.count + jnp.where(good, 1, 0)
        status = jnp.where(
            good & lands,
            _BOUND,
            jnp.where(
                ~good & (step < settings.min_step),
                _SHORT,
                jnp.where(count == plan.points, _FULL, _RUNNING),
            ),
        )
        running = lane.status == _RUNNING
        taken = running & good
        at = jax.tree.map(lambda new, old: jnp.where(taken, new, old), b, a)
        passed = jax.tree.map(
            lambda buffer, new: buffer.at[lane.count].set(
                jnp.where(taken, new, buffer[lane.count])
            ),
            lane.passed,
            b,
        )
        return Lane(
            at=at,
            step=jnp.where(running, step, lane.step),
            count=jnp.where(running, count, lane.count),
            status=jnp.where(running, status, lane.status),
            passed=passed,
        )

    def going(carry):
        lanes, done = carry
        return jnp.any(lanes.status == _RUNNING) & (done < rounds)

    def together(carry):
        lanes, done = carry
        return plan.mapped(advance, lanes), done + 1

    return jax.lax.while_loop(going, together, (lanes, jnp.zeros_like(rounds)))[0]
