"""How sure a named effect is: unseen records, redrawn blocks, and its limits."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from scipy.stats import chi2

from ..fitting import Fit, fit, Problem, Residuals, residuals
from ._engine import blocks_of, gain, off, with_states
from ._given_up import given_up
from ._trials import BEYOND, FALSE_ALARMS, SURE, Trial, Trials, values_of


# Stretches of a record, and pieces in each of them at least
_SLICES, _PIECES = 4, 8
_REDRAWN = 200
# Parts that records are dealt out to, each of which the others predict
_FOLDS = 3
# A fit to some of the records starts where the one to all of them ended
_ITERATIONS = 15


def held_out(
    trials: Trials, before: Trial, after: Trial, progress: Callable
) -> tuple[float, float, dict[str, float], tuple[list[Residuals], list[Residuals]]]:
    """Two models on records that their parameters have not seen.

    Records are dealt out to three parts, two records to two, and each part is predicted
    with what the others say. One record alone is cut in two.

    **Returns:** rms of the residuals in units of the noise, without and with the terms,
    what was gained in the logarithm of the likelihood, by record, and the residuals
    of both models.
    """
    problem = trials.problem
    unseen_parts: tuple[list[Residuals], list[Residuals]] = ([], [])
    folds = _folds(problem)
    squares, counts = np.zeros(2), np.zeros(2)
    gained: dict[str, float] = {}
    for fold, (seen, unseen) in enumerate(folds):
        costs = []
        for which, trial in enumerate((before, after)):
            done = (2 * fold + which) / (2 * len(folds))
            progress("predicting records not seen", done)
            known = fit(
                problem,
                free=trial.fit.free,
                start=trial.fit.point,
                weights=seen,
                iterations=_ITERATIONS,
                stop=given_up(problem.samples),
            )
            test = with_states(problem, known, unseen)
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
    return float(rms[0]), float(rms[1]), gained, unseen_parts


def rms_of(fitted: Fit) -> float:
    """Rms of the residuals of a fit on its own records, in units of the noise."""
    square, count = _square(residuals(fitted))
    return math.sqrt(square / max(count, 1))


def _square(parts: list[Residuals]) -> tuple[float, int]:
    """Sum of the squares in units of the noise, and the number of samples."""
    square = sum(float(np.sum((part.value / part.noise) ** 2)) for part in parts)
    return square, sum(len(part.value) for part in parts)


def _folds(problem: Problem):
    """Weights of what is seen and what is not, for each part of the records."""
    names = problem.records
    if len(names) == 1:
        middle = problem.segments[0].recording.time.mean()
        halves = problem.between(-np.inf, middle), problem.between(middle, np.inf)
        return [halves, halves[::-1]]
    count = min(_FOLDS, len(names))
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


def sure(
    trials: Trials, best: Trial, seed: int = 0
) -> tuple[Trial, dict[str, float], dict[str, float], list[tuple[str, float]]]:
    """The part of a subset that does not hang on a few stretches of the records.

    A term whose strength might be zero is dropped first, then the one that fewest of
    the redrawn sets need.

    **Returns:** the fit, what `redrawn` says of it, and the terms that were dropped
    with the part of the redrawn sets that would have kept them.
    """
    doubtful: list[tuple[str, float]] = []
    while True:
        inclusion, deviation = redrawn(trials, best, seed)
        sizes = {name: _size(trials, best, name, deviation) for name in inclusion}
        least = min(
            sizes, key=lambda n: (min(sizes[n], 1.0), inclusion[n]), default=None
        )
        if least is None or (sizes[least] >= 1 and inclusion[least] >= SURE):
            return best, inclusion, deviation, doubtful
        doubtful.append((least, inclusion[least]))
        best = trials.without(best, least)


def _size(trials: Trials, best: Trial, name: str, deviation) -> float:
    """Strengths of a term beside what redrawing does to them; below one, maybe zero."""
    own = [one.name for one in trials.term(name).strengths() if not one.inner]
    found = [best.fit[one] for one in own]
    errors = [max(one.stderr, deviation[one.name]) for one in found]
    size = sum((one.value / error) ** 2 for one, error in zip(found, errors))
    return float(size / chi2.isf(FALSE_ALARMS, len(own)))


def redrawn(
    trials: Trials, best: Trial, seed: int = 0
) -> tuple[dict[str, float], dict[str, float]]:
    """Draw stretches of the records again, a second or so each.

    **Returns:** of each term, in which part of the redrawn sets it would be kept,
    because a fit without it is worse by BIC; and the standard deviation of each
    parameter.
    """
    problem = trials.problem
    # what ties one stretch to the next is in neither, so they must hold many ties
    pieces = max(len(flown) for flown, _ in problem.spans)
    slices = min(_SLICES, max(1, pieces // _PIECES))
    blocks = blocks_of(problem, best.fit.point, slices)
    free = blocks.rows(_inside(best.fit))
    value = values_of(best.fit, blocks)
    rng = np.random.default_rng(seed)
    kept = dict.fromkeys(sorted(best.names), 0)
    own = {
        name: blocks.rows([one.name for one in trials.term(name).strengths()])
        for name in kept
    }
    estimates = []
    number = len(blocks.record)
    for _ in range(_REDRAWN):
        weight = np.bincount(rng.integers(0, number, number), minlength=number)
        information, score = blocks.total(weight.astype(float))
        step, _ = off(information, score, free)
        estimates.append((value[free] + step) * blocks.scale[free])
        top = gain(information, score, free)
        for name in kept:
            lost = _lost(information, score, value, free, own[name], top)
            kept[name] += bool(lost > len(own[name]) * math.log(problem.samples))
    spread = np.std(np.array(estimates), axis=0)
    deviation = dict.fromkeys(best.fit.free, 0.0)
    deviation |= {blocks.names[k]: float(s) for k, s in zip(free, spread)}
    return {name: k / _REDRAWN for name, k in kept.items()}, deviation


def _inside(found: Fit) -> list[str]:
    """Free parameters but those that press against a bound, where they stay."""
    values = np.asarray(found.point.values)
    kept = []
    for name in found.free:
        parameter = found.problem.parameter(name)
        column = values[:, found.problem.names.index(name)]
        if np.all((column > parameter.lower) & (column < parameter.upper)):
            kept.append(name)
    return kept


def _lost(information, score, value, free, gone, top: float) -> float:
    """What is lost where some strengths are zero and all else is fitted again."""
    step = np.zeros(len(value))
    step[gone] = -value[gone]
    lost = step @ information @ step - 2 * step @ score
    moved = score - information @ step
    return top + lost - gain(information, moved, np.setdiff1d(free, gone))


def limits(trials: Trials, trial: Trial) -> dict[str, tuple[float, float, str]]:
    """Least strength of each term, beside those of a trial, that would be named.

    **Returns:** by the name of the parameter, that strength, its standard error, and
    the parameter of the rig that would take up most of it.
    """
    blocks = trials.blocks(trial)
    information, score = blocks.total()
    free = blocks.rows(trials.parameters(trial.names))
    rig = blocks.rows(trials.rig)
    found = {}
    for term in trials.terms:
        if term.name in trial.names:
            continue
        for one in term.strengths():
            if one.inner:
                continue
            row = blocks.rows([one.name])
            rows = np.union1d(free, row)
            _, covariance = off(information, score, rows)
            place = np.searchsorted(rows, row[0])
            stderr = math.sqrt(abs(covariance[place, place]))
            # without the term, the rig moves by what its columns have in common with it
            across = np.zeros(len(blocks.names))
            across[rig] = information[rig, row[0]]
            taken, spread = off(information, across, rig)
            own = np.sqrt(np.diag(spread))
            hidden = ""
            if len(rig):
                hidden = blocks.names[rig[int(np.argmax(np.abs(taken) / own))]]
            size = stderr * float(blocks.scale[row[0]])
            asked = math.sqrt(trials.asked(term.name)) + BEYOND
            found[one.name] = (size * asked, size, hidden)
    return found
