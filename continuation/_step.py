"""Take one step of a given length."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ._context import Context
from ._point import with_field
from ._program import correct, Corrected
from .algorithms import AbstractAlgorithm
from .predictors import Station
from .problem import AbstractProblem
from .special import AbstractExtended
from .step_control import measure_step, Refusal


class StepAttempt(NamedTuple):
    """The outcome of a step."""

    at: Corrected | None
    """The point at the end of the step; None if the step is rejected."""
    bound: str = ""
    """The bound on which the step ends, as a sentence; empty if there is none."""
    following: float = 0.0
    """Length of the next step."""
    refusal: Refusal | None = None
    """Reason for rejecting the step."""
    solution: Corrected | None = None
    """The solution, if the corrector converged but the step is rejected because the
    correction is too long or the branch turns too sharply."""


def attempt_step(
    problem: AbstractProblem,
    context: Context,
    algorithm: AbstractAlgorithm,
    a: Corrected,
    stations: Sequence[Station],
    step: float,
    name: str,
) -> StepAttempt:
    """Return the outcome of a step, which ends on a bound if it would cross it."""
    predicted = algorithm.predictor(stations, step) * a.scale
    k, value = _first_bound(problem, context, a.z, predicted)
    if k is None:
        normal = algorithm.normal(stations[-1].tangent) / a.scale
        b = correct(
            problem, context, predicted, normal, a.tangent, algorithm.least_norm
        )
        guess = predicted
        if b.success:
            k, value = _first_bound(problem, context, a.z, b.z)
            predicted = b.z
        if k is None:
            return _judged(algorithm, context, a, b, guess, step, "")
    share = (value - a.z[k]) / (predicted[k] - a.z[k])
    guess = a.z + share * (predicted - a.z)
    guess[k] = value
    normal = np.zeros_like(guess)
    normal[k] = 1.0 / a.scale[k]
    b = correct(problem, context, guess, normal, a.tangent)
    if b.success:
        # remove the rounding error of the corrector
        z = np.array(b.z)
        z[k] = value
        b = with_field(b, "z", z)
    words = name if k == a.z.size - 1 else "the first parameter"
    bound = f"{words} is at its bound {value:g}"
    return _judged(algorithm, context, a, b, guess, step, bound)


def _judged(
    algorithm: AbstractAlgorithm,
    context: Context,
    a: Corrected,
    b: Corrected,
    guess: np.ndarray,
    step: float,
    bound: str,
) -> StepAttempt:
    if not b.success or not np.all(np.isfinite(b.tangent)):
        return StepAttempt(None, refusal=Refusal.NOT_CONVERGED)
    measures = measure_step(a, b, guess)
    control, settings = algorithm.control, context.settings
    for reason, holds in control.refusals(measures, step, settings).items():
        if holds:
            return StepAttempt(None, bound, refusal=reason, solution=b)
    return StepAttempt(b, bound, float(control.next_step(measures, step, settings)))


def _first_bound(
    problem: AbstractProblem, context: Context, z: np.ndarray, target: np.ndarray
) -> tuple[int | None, float]:
    """Return the index of the parameter that leaves its bounds first on the way from z
    to `target`, and the bound that it crosses; the index is None if no bound is
    crossed.
    """
    bounds = {z.size - 1: context.bounds}
    if isinstance(problem, AbstractExtended):
        low, high = problem.bounds
        bounds[z.size - 2] = float(low), float(high)
    first, which = np.inf, (None, 0.0)
    for k, (low, high) in bounds.items():
        for bound, beyond in ((low, target[k] < low), (high, target[k] > high)):
            share = (bound - z[k]) / (target[k] - z[k]) if beyond else np.inf
            if beyond and share < first:
                first, which = share, (k, bound)
    return which
