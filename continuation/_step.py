"""One step of a given length, and the length of the next."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ._algorithms import AbstractAlgorithm
from ._point import with_field
from ._predictors import Station
from ._problem import AbstractProblem
from ._program import correct, Corrected
from ._settings import Settings
from .special import Context


class Attempt(NamedTuple):
    """What came of a step."""

    at: Corrected | None
    #: why it is not taken, as the end of a sentence; empty if it is
    refusal: str
    #: which bound it ends on, as a sentence; empty if none
    bound: str
    angle: float


class StepControl:
    """Tries steps and chooses their length by effort and angle (the thesis, 3.4.4)."""

    def __init__(self, settings: Settings):
        self.settings = settings

    def attempt(
        self,
        problem: AbstractProblem,
        context: Context,
        algorithm: AbstractAlgorithm,
        a: Corrected,
        stations: Sequence[Station],
        step: float,
        name: str,
    ) -> Attempt:
        """Predict and correct; never past a bound, but onto it."""
        current = stations[-1]
        scale = a.scale
        predicted = algorithm.predictor(stations, step) * scale
        k, value = _first_bound(problem, context, a.z, predicted)
        if k is None:
            normal = algorithm.normal(current.tangent) / scale
            b = correct(
                problem, context.leaf, predicted, normal, a.tangent, context.width,
                self.settings, algorithm.least_norm,
            )  # fmt: skip
            if b.success:
                k, value = _first_bound(problem, context, a.z, b.z)
                predicted = b.z
            if k is None:
                return self._judged(a, b, predicted, step, "")
        share = (value - a.z[k]) / (predicted[k] - a.z[k])
        guess = a.z + share * (predicted - a.z)
        guess[k] = value
        normal = np.zeros_like(guess)
        normal[k] = 1.0 / scale[k]
        b = correct(
            problem,
            context.leaf,
            guess,
            normal,
            a.tangent,
            context.width,
            self.settings,
        )
        if b.success:
            # rounding of the corrector
            z = np.array(b.z)
            z[k] = value
            b = with_field(b, "z", z)
        words = name if k == a.z.size - 1 else f"component {k} of the state"
        if k == a.z.size - 2 and problem.free(a.z[:-1]):
            words = "the first parameter"
        return self._judged(a, b, guess, step, f"{words} is at its bound {value:g}")

    def _judged(
        self, a: Corrected, b: Corrected, guess: np.ndarray, step: float, bound: str
    ) -> Attempt:
        if not b.success or not np.all(np.isfinite(b.tangent)):
            tries = int(b.iterations)
            return Attempt(
                None, f"the corrector did not converge in {tries} iterations", "", 0.0
            )
        moved = float(np.linalg.norm((b.z - guess) / a.scale))
        if moved > step:
            return Attempt(
                None, "the corrector went farther than the step was long", "", 0.0
            )
        old, new = a.tangent / b.scale, b.tangent / b.scale
        cosine = float(old @ new) / float(np.linalg.norm(old) * np.linalg.norm(new))
        angle = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
        if angle > self.settings.max_angle:
            return Attempt(
                None, f"the branch turned by {np.degrees(angle):.0f} degrees", "", angle
            )
        return Attempt(b, "", bound, angle)

    def next_step(self, attempt: Attempt, step: float) -> float:
        """Longer where the corrector was quick and the branch straight."""
        s, at = self.settings, attempt.at
        assert at is not None
        effort = 2.0 ** ((s.iterations - int(at.iterations)) / 2)
        straight = s.angle / max(attempt.angle, 1e-3 * s.angle)
        factor = min(max(min(effort, straight), 0.5), 2.0)
        return float(min(max(step * factor, s.min_step), s.max_step))


def _first_bound(
    problem: AbstractProblem, context: Context, z: np.ndarray, target: np.ndarray
) -> tuple[int | None, float]:
    """The component that leaves its bounds first on the way, and the bound."""
    limits = {z.size - 1: context.bounds}
    for k, pair in problem.limits().items():
        limits[k if k >= 0 else z.size - 1 + k] = pair
    first, which = np.inf, (None, 0.0)
    for k, (low, high) in limits.items():
        for bound, beyond in ((low, target[k] < low), (high, target[k] > high)):
            share = (bound - z[k]) / (target[k] - z[k]) if beyond else np.inf
            if beyond and share < first:
                first, which = share, (k, bound)
    return which
