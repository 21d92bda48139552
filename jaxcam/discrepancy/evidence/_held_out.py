"""Predict held-out sections of the recordings with two models."""

import dataclasses
import math
from typing import NamedTuple

import jax
import numpy as np

from ...fitting import Fit, fit, Problem, Residuals, residuals
from ...fitting.engine import cost_by_recording, Weights
from ..policy import Policy
from ..search import given_up, heat_of, tolerance_at, Trial, Trials, with_states


# Seed that assigns sections to parts; fixed, so that two diagnoses of a case agree
_SEED = 1


class HeldOut(NamedTuple):
    """Predictions of two models on held-out sections of the recordings.

    - `before`, `after`: rms of the residuals in units of the noise, without and with
        the terms.
    - `gained`: increase in the log-likelihood, by recording.
    - `residuals`: residuals of both models.
    """

    before: float
    after: float
    gained: dict[str, float]
    residuals: tuple[list[Residuals], list[Residuals]]

    @property
    def total(self) -> float:
        """Increase in the log-likelihood of all recordings."""
        return sum(self.gained.values())


def held_out(trials: Trials, before: Trial, after: Trial) -> HeldOut:
    """Predict held-out data with two models.

    Every recording is divided into short sections, which are distributed over a few
    parts (two for a single recording). Each part is predicted from the others.
    """
    problem = trials.problem
    unseen_parts: tuple[list[Residuals], list[Residuals]] = ([], [])
    folds = folds_of(problem, trials.policy)
    squares, counts = np.zeros(2), np.zeros(2)
    gained: dict[str, float] = {}
    for fold, (seen, unseen) in enumerate(folds):
        costs = []
        for which, trial in enumerate((before, after)):
            done = (2 * fold + which) / (2 * len(folds))
            trials.progress("predicting held-out data", done)
            own = trial.fit.problem
            known = fit(
                own,
                free=trial.fit.free,
                start=trial.fit.point,
                weights=seen,
                iterations=trials.policy.heldout_iterations,
                stop=given_up(problem.samples, trials.policy),
                tolerance=tolerance_at(heat_of(trial.fit)),
            )
            test = with_states(own, known, unseen, trials.policy)
            parts = _parts(test, unseen)
            unseen_parts[which].extend(parts)
            square, count = _square(parts)
            squares[which] += square
            counts[which] += count
            costs.append(cost_by_recording(test.costs, unseen))
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
    """Return the rms residual of a fit on its own recordings, in units of the noise."""
    square, count = _square(residuals(fitted))
    return math.sqrt(square / max(count, 1))


def _square(parts: list[Residuals]) -> tuple[float, int]:
    """Return the sum of the squared residuals, in units of the noise, and the number of
    samples.
    """
    square = sum(float(np.sum((part.value / part.noise) ** 2)) for part in parts)
    return square, sum(len(part.value) for part in parts)


def folds_of(problem: Problem, policy: Policy) -> list[tuple[Weights, Weights]]:
    """Return weights of the fitted and the held-out data, for each part.

    Every recording is divided into short sections. From each group of successive
    sections, every part receives one at random: if sections were assigned in turn, all
    visits of a periodic motion to a constraint could end up in one part.
    """
    count = policy.folds if len(problem.records) > 1 else 2
    every = problem.everything()
    unseen = [jax.tree.map(np.zeros_like, every) for _ in range(count)]
    rng = np.random.default_rng(_SEED)
    for row, segments in enumerate(problem.segments):
        time = segments.recording.time
        pieces = len(problem.spans[row][0])
        rounds = max(1, pieces // (count * policy.stretch_pieces))
        edges = np.linspace(time[0], time[-1], count * rounds + 1)
        edges[0], edges[-1] = -np.inf, np.inf
        parts = np.concatenate([rng.permutation(count) for _ in range(rounds)])
        for number, part in enumerate(parts):
            section = problem.between(edges[number], edges[number + 1])
            unseen[part].flown[row] += section.flown[row]
            unseen[part].rested[row] += section.rested[row]
    return [
        (Weights(every.flown - one.flown, every.rested - one.rested), one)
        for one in unseen
    ]


def _parts(test: Fit, unseen) -> list[Residuals]:
    """Return the residuals of the held-out pieces."""
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
