"""Take the steps of many branches in one compiled program."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxcam.hybrid.programs import program

from ._point import set_parameters, with_field
from ._program import correct_, Corrected
from .predictors import Station
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


def follow_lanes(
    problem, algorithm, given, axes, leaf, z, signs, low, high, s, points, progress,
):  # fmt: skip
    """Follow all branches to their ends.

    **Arguments:** the problem; an algorithm that predicts from one point; the
    parameters `given` to the problem, and `axes`, which marks those that differ between
    branches; the `leaf` that is continued; for each branch, a point `z` and the sign of
    its direction; the bounds; settings from `as_traced`; the maximum number of
    `points`; and `progress`, which is called with the completed fraction, or None.

    Returns:
        The final `Lane` of each branch.
    """
    lanes = _begin(problem, given, axes, leaf, z, signs, low, high, s, points)
    rounds = np.asarray(_WHOLE if progress is None else _ROUNDS)
    while np.any(lanes.status == _RUNNING):
        lanes = _advance(
            problem, algorithm, given, axes, leaf, lanes, low, high, s, points, rounds
        )
        if progress is not None:
            # a branch that has ended counts as complete
            done = np.where(lanes.status == _RUNNING, lanes.count / points, 1.0)
            progress(float(np.mean(done)))
    return lanes


@program
def _begin(problem, given, axes, leaf, z, signs, low, high, s, points):
    """Return the `Lane` of each branch at its first point."""
    width = high - low

    def begin(parameters, z, sign):
        current = set_parameters(problem, parameters)
        across = jnp.zeros_like(z).at[-1].set(1.0)
        at = correct_(current, leaf, z, across, across, width, s.tolerance, 30, False)
        turn = jnp.where(at.tangent[-1] * sign < 0, -1.0, 1.0)
        tangent = turn * at.tangent
        at = with_field(at, "tangent", tangent)
        # the determinant of the Jacobian bordered by the tangent changes sign with it
        at = with_field(at, "determinant", turn * at.determinant)
        buffer = jax.tree.map(
            lambda x: jnp.zeros((points, *x.shape), x.dtype).at[0].set(x), at
        )
        good = at.success & jnp.all(jnp.isfinite(tangent))
        return Lane(
            at=at,
            step=s.step,
            count=jnp.where(good, 1, 0),
            status=jnp.where(good, _RUNNING, _NO_START),
            passed=buffer,
        )

    return jax.vmap(begin, in_axes=(axes.tree, 0, 0))(given, z, signs)


@program
def _advance(
    problem, algorithm, given, axes, leaf, lanes, low, high, s, points, rounds,
):  # fmt: skip
    """Attempt up to `rounds` steps on each branch that has not ended."""
    width = high - low

    def advance(parameters, lane: Lane) -> Lane:
        current = set_parameters(problem, parameters)
        a, control = lane.at, algorithm.control
        tangent = a.tangent / a.scale / jnp.linalg.norm(a.tangent / a.scale)
        stations = [Station(a.z / a.scale, tangent)]
        change = algorithm.predictor(stations, lane.step) * a.scale - a.z
        target = a.z[-1] + change[-1]
        bound = jnp.where(change[-1] > 0, high, low)
        lands = (target > high) | (target < low)
        share = jnp.where(lands, (bound - a.z[-1]) / change[-1], 1.0)
        guess = a.z + share * change
        guess = guess.at[-1].set(jnp.where(lands, bound, guess[-1]))
        across = jnp.zeros_like(a.z).at[-1].set(1.0 / width)
        normal = jnp.where(lands, across, algorithm.normal(tangent) / a.scale)
        b = correct_(
            current, leaf, guess, normal, a.tangent, width, s.tolerance,
            s.max_iterations, False,
        )  # fmt: skip
        z = b.z.at[-1].set(jnp.where(lands, bound, b.z[-1]))
        b = with_field(b, "z", z)
        measures = measure_step(a, b, guess)
        refused = list(control.refusals(measures, lane.step, s).values())
        inside = (low <= z[-1]) & (z[-1] <= high)
        finite = jnp.all(jnp.isfinite(b.tangent))
        good = b.success & finite & inside & ~jnp.any(jnp.stack(refused))
        following = control.next_step(measures, lane.step, s)
        step = jnp.where(good, following, lane.step / 2)
        count = lane.count + jnp.where(good, 1, 0)
        status = jnp.where(
            good & lands,
            _BOUND,
            jnp.where(
                ~good & (step < s.min_step),
                _SHORT,
                jnp.where(count == points, _FULL, _RUNNING),
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
        return jax.vmap(advance, in_axes=(axes.tree, 0))(given, lanes), done + 1

    return jax.lax.while_loop(going, together, (lanes, jnp.zeros_like(rounds)))[0]
