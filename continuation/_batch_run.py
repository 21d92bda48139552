"""The steps of many branches as one compiled program."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import PyTree

from ._point import set_parameters, with_field
from ._program import correct_, Corrected, scale_at
from ._settings import Settings


_RUNNING, _BOUND, _SHORT, _FULL, _NO_START = range(5)
REASONS = (
    "running",
    "the parameter is at its bound",
    "the step was halved down to the smallest and the corrector still failed, or the "
    "branch turned too sharply",
    "as many points as were asked for",
    "the start is no solution, and Newton's method finds none near it",
)


class Lane(NamedTuple):
    """One branch of the batch on its way."""

    at: Corrected
    step: jax.Array
    count: jax.Array
    status: jax.Array
    passed: Corrected


class Axes(eqx.Module):
    """Which parameters differ from lane to lane; static."""

    tree: PyTree = eqx.field(static=True)


class Numbers(NamedTuple):
    """The settings that may differ between calls of one compiled program."""

    tolerance: Any
    iterations: Any
    step: Any
    min_step: Any
    max_step: Any
    angle: Any
    max_angle: Any


def numbers_of(s: Settings) -> Numbers:
    """The numbers among the settings."""
    return Numbers(
        s.tolerance, float(s.iterations), s.step, s.min_step, s.max_step, s.angle,
        s.max_angle,
    )  # fmt: skip


@eqx.filter_jit
def run_lanes(
    problem, given, axes, leaf, z, signs, low, high, s, max_iterations, points
):
    """All branches to their ends.

    **Arguments:** the problem; parameters `given` to it, which differ between lanes by
    `axes`, and the `leaf` that is followed; for each lane a point `z` and the sign of
    its direction; bounds; `s` from `numbers_of`; and how many `points` at most.

    **Returns:** the last `Lane` of each branch.
    """
    width = high - low

    def begin(parameters, z, sign):
        current = set_parameters(problem, parameters)
        across = jnp.zeros_like(z).at[-1].set(1.0)
        at = correct_(current, leaf, z, across, across, width, s.tolerance, 30, False)
        turn = jnp.where(at.tangent[-1] * sign < 0, -1.0, 1.0)
        tangent = turn * at.tangent
        at = with_field(at, "tangent", tangent)
        # the determinant of jacobian and tangent turns with the tangent
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

    def advance(parameters, lane: Lane) -> Lane:
        current = set_parameters(problem, parameters)
        a = lane.at
        scale = scale_at(current, leaf, a.z, width)
        change = lane.step * a.tangent
        target = a.z[-1] + change[-1]
        bound = jnp.where(change[-1] > 0, high, low)
        lands = (target > high) | (target < low)
        share = jnp.where(lands, (bound - a.z[-1]) / change[-1], 1.0)
        guess = a.z + share * change
        guess = guess.at[-1].set(jnp.where(lands, bound, guess[-1]))
        across = jnp.zeros_like(scale).at[-1].set(1.0 / width)
        normal = jnp.where(lands, across, a.tangent / scale**2)
        b = correct_(
            current, leaf, guess, normal, a.tangent, width, s.tolerance, max_iterations,
            False,
        )  # fmt: skip
        z = b.z.at[-1].set(jnp.where(lands, bound, b.z[-1]))
        b = with_field(b, "z", z)
        old, new = a.tangent / b.scale, b.tangent / b.scale
        cosine = jnp.dot(old, new) / (jnp.linalg.norm(old) * jnp.linalg.norm(new))
        angle = jnp.arccos(jnp.clip(cosine, -1.0, 1.0))
        moved = jnp.linalg.norm((z - guess) / scale)
        inside = (low <= z[-1]) & (z[-1] <= high)
        good = b.success & (angle <= s.max_angle) & (moved <= lane.step) & inside
        effort = 2.0 ** ((s.iterations - b.iterations.astype(float)) / 2)
        straight = s.angle / jnp.maximum(angle, 1e-3 * s.angle)
        factor = jnp.clip(jnp.minimum(effort, straight), 0.5, 2.0)
        step = jnp.where(
            good, jnp.clip(lane.step * factor, s.min_step, s.max_step), lane.step / 2
        )
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

    lanes = jax.vmap(begin, in_axes=(axes.tree, 0, 0))(given, z, signs)
    return jax.lax.while_loop(
        lambda lanes: jnp.any(lanes.status == _RUNNING),
        lambda lanes: jax.vmap(advance, in_axes=(axes.tree, 0))(given, lanes),
        lanes,
    )
