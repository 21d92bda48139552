"""Fit the parameters of a `Problem` by Levenberg-Marquardt, eliminating the states."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ._doubts import far_from_data
from ._fit_result import finish, Fit
from .engine import (
    already_loose,
    assemble,
    Blocks,
    Costs,
    damped_step,
    free_columns,
    inside,
    loosened,
    own_states,
    Point,
    prior_cost,
    Problem,
    total_cost,
    Weights,
)


_ITERATIONS = 60
PROMISE = 1e-3
"""The iteration ends if the predicted gain in twice the log-likelihood is below this
value.
"""
# Largest gain predicted for an undamped step at an optimum: such a step changes no
# parameter by more than a tenth of its standard error
_GRADIENT = 1e-2
# Maximum number of corrections before a step is accepted or rejected
_CORRECTIONS = 3
# Each correction must reduce the excess cost to less than this fraction of its previous
# value
_LEADS_BACK = 0.5
# A flight with more pieces than this is first fitted with loose joints
_LONG = 16
# Factors on parameters without a tolerance, for restarts of a fit that ended far from
# the data
_FACTORS = (0.7, 1.4, 0.5, 2.0)
# Initial, minimum and maximum damping, relative to the scales of the parameters
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1.0, 1e-6, 1e12
# Factor on the damping after a good step, and factor after a poor step or after a good
# step that follows a rejected one
_EASED, _POOR = 0.1, 0.5


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

    If neither `start` nor `stop` is given and the fit ends far above the noise, it is
    repeated from other starting points, and the best fit is returned.

    Args:
        problem: The problem.
        free: Names of the parameters to fit; default: all. The others keep the values
            of `start`.
        start: Another fit, or values of some parameters; default: the nominal ones.
        weights: Weight of each piece of the data.
        prior: Whether the tolerances count as prior knowledge; bounds always apply.
        iterations: Maximum number of iterations.
        stop: Called after each iteration with all costs so far, including that of the
            start; if it returns True, the fit ends without convergence. Long flights
            are first fitted to convergence with relaxed continuity conditions between
            pieces; only the costs of the subsequent iterations are passed.
        progress: Called with the iteration number and the cost.

    Returns:
        A [`jaxcam.fitting.Fit`][]. Its `converged` is true only if the fit is at an
            optimum away from all bounds, the noise explains the residuals, and every
            standard error is finite; if not, `reasons` lists what is wrong.

    Raises:
        ValueError: A name is not a parameter.

    Examples:
        >>> from jaxcam import fitting, recordings
        >>> from jaxcam.models import BouncingBall
        >>> ball, rng = BouncingBall(), np.random.default_rng(0)
        >>> sensors = {"height_m": fitting.Sensor(0, noise=1e-3)}
        >>> run = recordings.record(ball, sensors, 1.0, rng=rng, state=[1.0, 0.0])
        >>> parts = recordings.segment(run, "height_m", 0.0)
        >>> gravity = fitting.Parameter("gravity", lambda m: m.system.gravity, 1.0)
        >>> model = fitting.Model(ball, sensors)
        >>> problem = fitting.Problem.build(model, [parts], [gravity])
        >>> found = fitting.fit(problem)
        >>> abs(found.estimates[0].value - 9.81) < 4 * found.estimates[0].stderr
        True
    """
    columns = free_columns(problem, free)
    point = start_point(problem, start)
    point = inside(problem, columns, point)
    extras = problem.weighted(weights)
    fresh = point.states is problem.start.states

    def loosely():
        loose = loosened(extras)
        most = max(iterations, _ITERATIONS)
        return _descend(problem, columns, loose, point, prior, most).point

    long = problem.longest_flight > _LONG and fresh and not already_loose(extras)
    first = loosely() if long else point
    found = _descend(problem, columns, extras, first, prior, iterations, stop, progress)
    # if the cost is far above the noise, there may be a better optimum; a caller who
    # gives `stop` or `start` has to search for it
    if fresh and stop is None and iterations > 0 and _far(problem, found, weights):
        for other in _other_starts(problem, columns, extras, point, prior, loosely):
            again = _descend(problem, columns, extras, other, prior, iterations)
            if np.isfinite(again.cost) and not again.cost >= found.cost:
                found = again
            if not _far(problem, found, weights):
                break
    return finish(problem, columns, *found, prior=prior, weights=weights)


class _Descent(NamedTuple):
    """The end point of an iteration and the reason it ended."""

    point: Point
    blocks: Blocks
    costs: Costs
    cost: float
    optimal: bool
    count: int
    ended: str


def _far(problem, found: _Descent, weights) -> bool:
    costs = jax.device_get(found.costs)
    return not np.isfinite(found.cost) or bool(far_from_data(problem, costs, weights))


def _other_starts(problem, columns, extras, point, prior, loosely):
    """Yield other starting points for a fit that ended far from the data.

    Each is the result of a fit with loose joints, first from the given point, then with
    parameters multiplied by a few factors: the cost of an oscillation over many periods
    has many local minima.
    """
    yield loosely()
    loose = loosened(extras)
    values = np.asarray(point.values)
    for factor in _FACTORS:
        moved = np.array(values)
        for p in set(columns.parameter.tolist()):
            one = problem.parameters[p]
            if math.isfinite(one.tolerance):
                continue
            moved[:, p] = np.clip(factor * values[:, p], one.lower, one.upper)
        if not np.array_equal(moved, values):
            start = own_states(
                problem.layout,
                problem.pieces,
                extras,
                Point(jnp.asarray(moved), point.states),
            )
            yield _descend(problem, columns, loose, start, prior, _ITERATIONS).point


def _descend(
    problem, columns, extras, point, prior, iterations, stop=None, progress=None
):
    """Iterate damped scoring from a point to an optimum near it."""
    local, scales = jnp.asarray(columns.local), jnp.asarray(columns.scales)

    def linearise(point):
        return assemble(problem.layout, problem.pieces, extras, point, local, scales)

    def total(costs, point):
        return total_cost(costs, extras) + prior_cost(problem, columns, point, prior)

    blocks, costs = linearise(point)
    cost = total(costs, point)
    damping, message, optimal, count = _FIRST_DAMPING, "", False, 0
    so_far = [cost]
    # factor on the damping after the next good step; number of steps rejected since the
    # last accepted one
    eased, raised = _EASED, 0
    while count < iterations:
        count += 1
        step, promise = damped_step(problem, columns, blocks, point, damping, prior)
        fine = np.isfinite(promise)
        if fine and promise < PROMISE:
            # in a valley, a damped step always predicts little gain; the undamped step
            # must predict little gain as well
            _, whole = damped_step(
                problem, columns, blocks, point, _LEAST_DAMPING, prior
            )
            if not whole > _GRADIENT or damping <= _LEAST_DAMPING:
                optimal, message = True, "The optimum was reached."
                break
            if damping <= 1e-1:
                damping = max(0.1 * damping, _LEAST_DAMPING)
        found, changed, value = blocks, costs, np.inf
        if fine:
            found, changed = linearise(step)
            value = total(changed, step)
        excess = np.inf
        for _ in range(_CORRECTIONS):
            # in a curved, steep valley, a long step ends on the slope: it is assessed
            # after corrections, as long as these lead back into the valley quickly
            if value <= cost or not value - cost < _LEADS_BACK * excess:
                break
            excess = value - cost
            step, _ = damped_step(problem, columns, found, step, damping, prior)
            found, changed = linearise(step)
            value = total(changed, step)
        if value <= cost and np.isfinite(value):
            gained = (cost - value) / max(promise, 1e-300)
            point, blocks, costs, cost = step, found, changed, value
            good = gained > 0.5
            damping = max(damping * (eased if good else _POOR), _LEAST_DAMPING)
            eased, raised = (_EASED if good and not raised else _POOR), 0
            if progress is not None:
                progress(count, cost)
        else:
            raised += 1
            damping *= 10**raised
            eased = _POOR
            if damping > _MOST_DAMPING:
                message = (
                    "No further step improves the fit, although it is not at an "
                    "optimum; check the residuals, or start from other values."
                )
                break
        so_far.append(cost)
        if stop is not None and stop(so_far):
            message = f"The fit was stopped after {count} iterations."
            break
    else:
        message = (
            f"The optimum was not reached in {iterations} iterations; allow more "
            "iterations, or start closer to it."
        )
    return _Descent(point, blocks, costs, cost, optimal, count, message)


def held_out_cost(problem: Problem, found: Fit, weights: Weights) -> float:
    """Return the cost of held-out data for a fit.

    The parameters are not changed; the states of the pieces are fitted to the data,
    because the parameters do not determine them. Joints (continuity conditions) between
    held-out pieces are included. The example continues the one in
    [`jaxcam.fitting.fit`][].

    Args:
        problem: The problem.
        found: The fit.
        weights: Weight of each piece of the data.

    Returns:
        Minus twice the log-likelihood.

    Examples:
        >>> from jaxcam.fitting import held_out_cost
        >>> held_out_cost(problem, found, problem.everything()) > 0
        True
    """
    other = fit(problem, free=(), start=found, weights=weights, prior=False)
    return other.cost


def start_point(problem: Problem, start) -> Point:
    """Return the starting point of the iteration."""
    if isinstance(start, Fit):
        return start.point
    if isinstance(start, Point):
        return start
    values = np.array(problem.start.values)
    for name, value in (start or {}).items():
        problem.parameter(name)
        values[:, problem.names.index(name)] = value
    return problem.start._replace(values=jnp.asarray(values))
