"""Fit the parameters of a `Problem` by Levenberg-Marquardt, eliminating the states."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ._descend import descend, Descent, Objective, TOLERANCE
from ._doubts import poor_fit
from ._equivalent_values import nearest_equivalent
from ._fit_result import finish, Fit
from ._own_value_starts import own_value_starts
from .engine import (
    already_loose,
    begun_before_switches,
    free_columns,
    inside,
    loosened,
    own_states,
    Point,
    Problem,
    unexplained_jumps,
    Weights,
)


_ITERATIONS = 60
# A flight with more pieces than this is first fitted with loose joints
_LONG = 16
# Maximum number of times that the discrete states of a system with memory are chosen
# anew, and the relative decrease of the cost below which this ends
_ROUNDS, _LITTLE = 6, 1e-3
# Factors on parameters without a tolerance, for restarts of a fit that ended far from
# the data
_FACTORS = (0.7, 1.4, 0.5, 2.0)


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
    tolerance: float = TOLERANCE,
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
        tolerance: Decrease of the cost (twice the log-likelihood) below which a further
            step is not worthwhile: the iteration ends if the predicted decrease is
            smaller. With a tolerance above about 0.1, a fit that counts as converged
            may be a noticeable fraction of the standard errors from the optimum.

    Returns:
        A [`jaxcam.fitting.Fit`][]. Its `converged` is true only if the fit is at an
            optimum away from all bounds, the noise explains the residuals, and every
            standard error is finite; if not, `reasons` lists what is wrong.

    Raises:
        ValueError: A name is not a parameter, or `tolerance` is not positive.

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
    if not 0 < tolerance < math.inf:
        raise ValueError(
            f"`tolerance` is {tolerance}; give a positive number, such as {TOLERANCE}."
        )
    columns = free_columns(problem, free)
    point = start_point(problem, start)
    point = inside(problem, columns, point)
    extras = problem.weighted(weights)
    fresh = point.states is problem.start.states

    objective = Objective(problem, columns, extras, prior)

    def loosely():
        most = max(iterations, _ITERATIONS)
        return _descend_loosely(objective, point, most)

    remembers = point.discrete is not None
    gently = problem.longest_flight > _LONG or remembers
    gently = gently and fresh and not already_loose(extras)
    first = loosely() if gently else point
    found = descend(objective, first, iterations, stop, progress, tolerance)
    if fresh and stop is None and iterations > 0 and remembers:
        found = _with_other_modes(objective, found, weights, iterations, tolerance)
    # if the cost is far above the noise, there may be a better optimum; a caller who
    # gives `stop` or `start` has to search for it
    if fresh and stop is None and iterations > 0 and _far(problem, found, weights):
        for other in _other_starts(objective, point, loosely):
            again = descend(objective, other, iterations, tolerance=tolerance)
            if np.isfinite(again.cost) and not again.cost >= found.cost:
                found = again
            if not _far(problem, found, weights):
                break
    if found.optimal:
        nearer = nearest_equivalent(objective, found.point, found.cost)
        if nearer is not None:
            again = descend(objective, nearer, iterations, tolerance=tolerance)
            if again.optimal and not again.cost > found.cost + tolerance:
                found = again._replace(count=found.count + again.count)
    return finish(problem, columns, *found, prior=prior, weights=weights)


def _descend_loosely(objective: Objective, point: Point, iterations: int) -> Point:
    """Return the end of a descent with loose joints within flights.

    For a system with several discrete states, the most likely ones are chosen again for
    the parameters found, until they no longer change: with inaccurate parameters, a
    piece may begin in the wrong one.
    """
    problem, loose = objective.problem, _loose(objective)
    for _ in range(_ROUNDS):
        point = descend(loose, point, iterations).point
        if point.discrete is None:
            break
        again = own_states(problem.layout, problem.pieces, loose.extras, point)
        if np.array_equal(np.asarray(again.discrete), np.asarray(point.discrete)):
            break
        point = again
    return point


def _with_other_modes(
    objective: Objective, found: Descent, weights, iterations: int, tolerance: float
) -> Descent:
    """Return the result of descents that begin again with the most likely discrete
    states for the parameters found so far, as long as they improve a poor fit.
    """
    problem = objective.problem
    for _ in range(_ROUNDS):
        at = problem.layout, problem.pieces, found.point
        jumps = unexplained_jumps(*at, objective.extras.weight)
        if found.optimal and not np.any(jumps) and not _far(problem, found, weights):
            break
        start = own_states(*at[:2], objective.extras, found.point)
        start = _descend_loosely(objective, start, _ITERATIONS)
        again = descend(objective, start, iterations, tolerance=tolerance)
        better = again.cost < found.cost * (1 - _LITTLE)
        found = again if again.cost < found.cost else found
        if not better:
            break
    for _ in range(_ROUNDS):
        start = begun_before_switches(problem.layout, problem.pieces, found.point)
        if start is None:
            break
        again = descend(objective, start, iterations, tolerance=tolerance)
        if not again.cost < found.cost:
            break
        found = again
    return found


def _far(problem, found: Descent, weights) -> bool:
    costs = jax.device_get(found.costs)
    return not np.isfinite(found.cost) or bool(poor_fit(problem, costs, weights))


def _loose(objective: Objective) -> Objective:
    """Return the objective with loose joints within flights."""
    return dataclasses.replace(objective, extras=loosened(objective.extras))


def _other_starts(objective: Objective, point: Point, loosely: Callable[[], Point]):
    """Yield other starting points for a poor fit.

    Each is the result of a fit with loose joints, first from the given point, then with
    other values of the parameters that differ between recordings, and with parameters
    multiplied by a few factors: the cost of an oscillation over many periods has many
    local minima.
    """
    yield loosely()
    problem = objective.problem
    own = own_value_starts(_loose(objective), point)
    if own is not None:
        yield descend(_loose(objective), own, _ITERATIONS).point
    values = np.asarray(point.values)
    for factor in _FACTORS:
        moved = np.array(values)
        for p in set(objective.columns.parameter.tolist()):
            one = problem.parameters[p]
            if math.isfinite(one.tolerance):
                continue
            moved[:, p] = np.clip(factor * values[:, p], one.lower, one.upper)
        if not np.array_equal(moved, values):
            at = point._replace(values=jnp.asarray(moved))
            start = own_states(problem.layout, problem.pieces, objective.extras, at)
            yield descend(_loose(objective), start, _ITERATIONS).point


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
