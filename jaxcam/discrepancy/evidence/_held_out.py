"""Records that no parameter has seen, predicted by two models."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from ...fitting import Fit, fit, Problem, Residuals, residuals
from ..search import given_up, Trial, Trials, with_states


class HeldOut(NamedTuple):
    """Two models on records that their parameters have not seen.

    - `before`, `after`: rms of the residuals in units of the noise, without and with
        the terms.
    - `gained`: growth of the log-likelihood, by record.
    - `residuals`: of both models.
    """

    before: float
    after: float
    gained: dict[str, float]
    residuals: tuple[list[Residuals], list[Residuals]]

    @property
    def total(self) -> float:
        """Growth of the log-likelihood of all records."""
        return sum(self.gained.values())


def held_out(trials: Trials, before: Trial, after: Trial) -> HeldOut:
    """Predict records that the parameters of two models have not seen.

    Records are dealt out to a few parts, two records to two, and each part is predicted
    with what the others say. One record alone is cut in two.
    """
    problem = trials.problem
    unseen_parts: tuple[list[Residuals], list[Residuals]] = ([], [])
    folds = _folds(problem, trials.policy.folds)
    squares, counts = np.zeros(2), np.zeros(2)
    gained: dict[str, float] = {}
    for fold, (seen, unseen) in enumerate(folds):
        costs = []
        for which, trial in enumerate((before, after)):
            done = (2 * fold + which) / (2 * len(folds))
            trials.progress("predicting records not seen", done)
            own = trial.fit.problem
            known = fit(
                own,
                free=trial.fit.free,
                start=trial.fit.point,
                weights=seen,
                iterations=trials.policy.heldout_iterations,
                stop=given_up(problem.samples, trials.policy),
            )
            test = with_states(own, known, unseen, trials.policy)
            parts = _parts(test, unseen)
            unseen_parts[which].extend(parts)
            square, count = _square(parts)
            squares[which] += square
            counts[which] += count
            flown = np.sum(
                np.asarray(unseen.flown)
                * (np.asarray(test.costs.flown) + np.asarray(test.costs.joints)),
                axis=1,
            )
            rested = np.sum(
                np.asarray(unseen.rested)
                * np.nan_to_num(np.asarray(test.costs.rested)),
                axis=1,
            )
            costs.append(flown + rested)
            if before.names == after.names:
                squares[1], counts[1] = squares[0], counts[0]
                unseen_parts[1].extend(parts)
                costs.append(costs[0])
                break
        for name, a, b in zip(problem.records, *costs):
            gained[name] = gained.get(name, 0.0) + float(a - b) / 2
    for parts in unseen_parts:
        parts.sort(key=lambda part: problem.records.index(part.record))
    rms = np.sqrt(squares / np.maximum(counts, 1))
    return HeldOut(float(rms[0]), float(rms[1]), gained, unseen_parts)


def rms_of(fitted: Fit) -> float:
    """Rms of the residuals of a fit on its own records, in units of the noise."""
    square, count = _square(residuals(fitted))
    return math.sqrt(square / max(count, 1))


def _square(parts: list[Residuals]) -> tuple[float, int]:
    """Sum of the squares in units of the noise, and the number of samples."""
    square = sum(float(np.sum((part.value / part.noise) ** 2)) for part in parts)
    return square, sum(len(part.value) for part in parts)


def _folds(problem: Problem, most: int):
    """Weights of what is seen and what is not, for each part of the records."""
    names = problem.records
    if len(names) == 1:
        middle = problem.segments[0].recording.time.mean()
        halves = problem.between(-np.inf, middle), problem.between(middle, np.inf)
        return [halves, halves[::-1]]
    count = min(most, len(names))
    dealt = [names[k::count] for k in range(count)]
    return [
        (problem.only([n for n in names if n not in part]), problem.only(part))
        for part in dealt
    ]


def _parts(test: Fit, unseen) -> list[Residuals]:
    """Residuals of the pieces that count."""
    found = []
    problem = test.problem
    for part in residuals(test):
        row = problem.records.index(part.record)
        inside = np.zeros(len(part.time), dtype=bool)
        for side, used in enumerate((unseen.flown[row], unseen.rested[row])):
            for span, weight in zip(problem.spans[row][side], used):
                if weight > 0:
                    within = (part.time >= span.start) & (part.time <= span.stop)
                    inside |= within & (part.resting == bool(side))
        if inside.any():
            pick = {
                name: getattr(part, name)[inside]
                for name in ("time", "turned", "value", "flight", "resting")
            }
            found.append(dataclasses.replace(part, **pick))
    return found
