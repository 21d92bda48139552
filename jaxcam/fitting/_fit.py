"""Levenberg-Marquardt on the parameters of a `Problem`, its states eliminated."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np

from ._columns import free_columns, inside, prior_cost
from ._damped_step import damped_step
from ._fit_result import finish, Fit
from ._linearise import assemble, Costs, Point
from ._problem import Problem, Weights
from ._sharpness import loosened


_ITERATIONS = 60
#: a step that promises less than this (twice the log-likelihood) is the last
PROMISE = 1e-3
# Steps that may follow before the first one is judged
_CORRECTIONS = 3
# A flight of more pieces than this is not foretold from its start at once
_LONG = 16
# in units of the parameters' scales, over which a model may bend
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1.0, 1e-6, 1e12


def fit(
    problem: Problem,
    *,
    free: Iterable[str] | None = None,
    start: Fit | Point | Mapping[str, float] | None = None,
    weights: Weights | None = None,
    prior: bool = True,
    iterations: int = _ITERATIONS,
    stop: Callable[[Sequence[float]], bool] | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit the free parameters of a problem.

    **Arguments:**

    - `free`: names of the parameters to fit; by default all of them. The others stay
        at the values of `start`.
    - `start`: another fit, or values of some parameters; by default the nominal ones.
    - `weights`: how much each piece of the data counts.
    - `prior`: whether the tolerances count as knowledge; bounds always hold.
    - `stop`: called after each iteration with the cost at the start and after every
        one so far; where it says so, the fit ends, not converged. Long flights are
        first fitted with loose joints, to the end; the costs are those that follow.
    - `progress`: called with the number of the iteration and the cost.

    **Raises:** `ValueError` for a name that is not a parameter.
    """
    columns = free_columns(problem, free)
    point = start_point(problem, start)
    point = inside(problem, columns, point)
    extras = problem.weighted(weights)
    if problem.longest_flight > _LONG and point.states is problem.start.states:
        loose = loosened(extras)
        most = max(iterations, _ITERATIONS)
        point = _descend(problem, columns, loose, point, prior, most)[0]
    found = _descend(problem, columns, extras, point, prior, iterations, stop, progress)
    point, blocks, costs, cost, converged, count, message = found
    return finish(
        problem, columns, point, blocks, costs, cost, prior, converged, count, message
    )


def _descend(
    problem, columns, extras, point, prior, iterations, stop=None, progress=None
):
    """Damped scoring from a point to an optimum near it."""
    local, scales = jnp.asarray(columns.local), jnp.asarray(columns.scales)

    def linearise(point):
        return assemble(problem.layout, problem.pieces, extras, point, local, scales)

    def total(costs, point):
        return total_cost(costs, extras) + prior_cost(problem, columns, point, prior)

    blocks, costs = linearise(point)
    cost = total(costs, point)
    damping, message, converged, count = _FIRST_DAMPING, "", False, 0
    so_far = [cost]
    while count < iterations:
        count += 1
        step, promise = damped_step(problem, columns, blocks, point, damping, prior)
        fine = np.isfinite(promise)
        if fine and promise < PROMISE and damping <= 1e-1:
            converged, message = True, "The optimum was reached."
            break
        found, changed, value = blocks, costs, np.inf
        if fine:
            found, changed = linearise(step)
            value = total(changed, step)
        for _ in range(_CORRECTIONS):
            # the valley is curved and steep: a long step along it ends on its side, and
            # is judged by where the next ones lead
            if value <= cost or not np.isfinite(value):
                break
            step, _ = damped_step(problem, columns, found, step, damping, prior)
            found, changed = linearise(step)
            value = total(changed, step)
        if value <= cost and np.isfinite(value):
            gained = (cost - value) / max(promise, 1e-300)
            point, blocks, costs, cost = step, found, changed, value
            damping = max(damping * (0.1 if gained > 0.5 else 0.5), _LEAST_DAMPING)
            if progress is not None:
                progress(count, cost)
        else:
            damping *= 10
            if damping > _MOST_DAMPING:
                message = (
                    "No step improves the fit any more although it is not at an "
                    "optimum; look at the residuals, or start elsewhere."
                )
                break
        so_far.append(cost)
        if stop is not None and stop(so_far):
            message = f"The fit was stopped after {count} iterations."
            break
    else:
        message = (
            f"The optimum was not reached in {iterations} iterations; allow more of "
            f"them, or start closer."
        )
    return point, blocks, costs, cost, converged, count, message


def held_out_cost(problem: Problem, found: Fit, weights: Weights) -> float:
    """Cost of data under a fit that need not have seen them.

    The parameters stay as they are; the states of the pieces are fitted to the data, as
    nobody can predict them. Joints between pieces that count are included.
    """
    other = fit(problem, free=(), start=found, weights=weights, prior=False)
    return other.cost


def start_point(problem: Problem, start) -> Point:
    """Where to begin."""
    if isinstance(start, Fit):
        return start.point
    if isinstance(start, Point):
        return start
    values = np.array(problem.start.values)
    for name, value in (start or {}).items():
        problem.parameter(name)
        values[:, problem.names.index(name)] = value
    return problem.start._replace(values=jnp.asarray(values))


def total_cost(costs: Costs, extras) -> float:
    """Cost of all pieces by their weights; a joint counts as the less of its two."""
    before = jnp.concatenate([extras.weight[:, :1], extras.weight[:, :-1]], axis=1)
    shared = jnp.minimum(extras.weight, before)
    parts = (
        jnp.sum(extras.weight * costs.flown),
        jnp.sum(shared * costs.joints),
        jnp.sum(extras.rest_weight * costs.rested),
    )
    return float(sum(parts))
