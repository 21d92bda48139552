"""Fit the reference speed of a named term if the rig file does not state it."""

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from ...fitting import Fit, fit
from ...recordings.cut import Impacts
from ..terms import Term, Value
from ._question import FittedSpeed, Question
from ._trials import Trial, Trials


# relative change of the speed for a parabola through the cost near its minimum; that
# for the second one, about the vertex of the first, in standard errors, and its minimum
_CHANGE = 0.1
_SECOND, _SMALLEST = 3.0, 0.01


def _approach(impacts: Impacts, term: Term) -> np.ndarray:
    """Return the approach speeds at the gaps at which a term acts."""
    here = [term.acts_at(int(side)) for side in impacts.side]
    return impacts.approach[np.array(here, dtype=bool)]


def with_fitted_speed(
    question: Question, trials: Trials, best: Trial
) -> Question | None:
    """Return the question with a fitted reference speed, or `None` if no named term has
    an unstated one, or if another speed explains no more.

    The speed is sought between the slowest impact and ten times the fastest one. Terms
    with a frequency take no part, because they may only imitate the error of the form.
    """
    term = next((t for t in question.terms if _unstated(t, question, best)), None)
    if term is None or question.relisted is None or trials.clock.over:
        return None
    every = [p.impacts for p in question.problem.segments]
    speeds = np.concatenate([_approach(i, term) for i in every])
    speeds = speeds[np.isfinite(speeds) & (speeds > 0)]
    if not len(speeds):
        return None
    trials.progress("fitting the reference speed", None)
    start = _with_strengths_only(trials, best)
    if start is None:
        return None
    free, policy = trials.parameters(start.names), trials.policy
    relisted = question.relisted

    def with_speed(logarithm: float) -> Question:
        speed = {term.reference_speed: math.exp(logarithm)}
        return relisted(question, dataclasses.replace(question.references, **speed))

    def fitted(logarithm: float) -> Fit:
        problem, most = with_speed(logarithm).problem, policy.quick_iterations
        return fit(problem, free=free, start=start.fit.point, iterations=most)

    found: Any = minimize_scalar(
        lambda logarithm: fitted(logarithm).cost,
        bounds=(math.log(speeds.min()), math.log(10 * speeds.max())),
        method="bounded",
        options={"maxiter": policy.element_fits},
    )
    price = math.log(trials.problem.samples) + policy.tie
    # with as many iterations as the others
    usual = fitted(math.log(getattr(question.references, term.reference_speed))).cost
    if not found.fun + price < usual:
        return None

    def about(logarithm: float, change: float) -> FittedSpeed:
        near = [fitted(logarithm + step) for step in (-change, 0.0, change)]
        return _of_fits(term, logarithm, near, change)

    speed = about(float(found.x), _CHANGE)
    error = speed.speed.stderr / speed.speed.value
    if _SECOND * error < _CHANGE:
        change = max(_SECOND * error, _SMALLEST)
        speed = about(math.log(speed.speed.value), change)
    best_speed = math.log(speed.speed.value)
    return dataclasses.replace(with_speed(best_speed), fitted_speed=speed)


def _unstated(term: Term, question: Question, best: Trial) -> bool:
    """Return whether a term is named and has a reference speed that is not stated."""
    return term.name in best.names and term.reference_speed in question.unstated


def _with_strengths_only(trials: Trials, best: Trial) -> Trial | None:
    """Return the fit of those terms of a subset that have no inner parameters."""
    names = frozenset(
        name
        for name in best.names
        if not any(one.inner for one in trials.term(name).strengths())
    )
    return trials.known.get(names) or trials.attempt(names, best)


def _of_fits(
    term: Term, logarithm: float, near: list[Fit], change: float
) -> FittedSpeed:
    """Return the speed with the least cost, with its standard error, from fits with a
    lower, the same and a higher speed.

    **Arguments:** the term, the logarithm of the speed, and the change in it.
    """
    less, here, more = (one.cost for one in near)
    # the cost is minus twice the log-likelihood
    curvature = (less - 2 * here + more) / change**2
    if curvature > 0:
        error = math.sqrt(2 / curvature)
        vertex = (less - more) / (2 * change * curvature)
        logarithm += min(max(vertex, -change), change)
    else:
        error = math.inf
    speed = math.exp(logarithm)
    moved = {
        one.label: abs(one.value - before.value) / (2 * change)
        for one, before in zip(near[2].estimates, near[0].estimates, strict=True)
    }
    errors = {label: rate * error for label, rate in moved.items() if rate > 0}
    unit = term.written("[q]/s")
    return FittedSpeed(term.name, Value(speed, error * speed, unit), errors)
