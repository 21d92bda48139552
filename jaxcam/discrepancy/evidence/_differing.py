"""Find a parameter that differs from recording to recording."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from ...fitting import Fit, fit
from ..policy import Policy
from ..search import Blocks, blocks_of, gain, given_up, newton_step
from ._held_out import rms_of


class Differing(NamedTuple):
    """A parameter with a separate value for each recording.

    - `values`, `stderr` `(r,)`: its value in each of the `records`.
    - `share`: share of the squared residual above the noise that the separate values
        explain; `left`: rms of the residual that remains, relative to the noise;
        `complete`: whether only noise remains.
    - `gained`: reduction of the cost; `fit`: the fit with separate values.
    - `terms`: number of parameters of named terms in this fit.
    """

    name: str
    unit: str
    records: tuple[str, ...]
    values: Float[np.ndarray, " r"]
    stderr: Float[np.ndarray, " r"]
    share: float
    left: float
    complete: bool
    gained: float
    fit: Fit
    terms: int = 0

    @property
    def bic(self) -> float:
        """Cost of the fit, and the price of its additional parameters."""
        count = self.terms + len(self.records) - 1
        return self.fit.cost + count * math.log(self.fit.problem.samples)

    def to_json(self) -> dict:
        """Return the results as plain numbers and text, for a file."""
        pairs = zip(self.values.tolist(), self.stderr.tolist())
        return {
            "parameter": self.name,
            "unit": self.unit,
            "values": dict(zip(self.records, map(list, pairs))),
            "share": self.share,
            "left": self.left,
        }


def above_noise(cost: float, samples: int, policy: Policy) -> bool:
    """Return whether the cost of a fit exceeds what the noise explains."""
    return cost > samples + policy.cost_errors * math.sqrt(2 * samples)


def differing(found: Fit, policy: Policy, terms: int = 0) -> Differing | None:
    """Return the free parameter whose separate values explain most of the residual.

    The gain of separate values must be significant, and the values estimated from one
    half of each recording must improve the prediction of the other half.

    **Arguments:** `terms`: the number of parameters of named terms.

    **Returns:** `None` if nothing remains above the noise, if there is only one
    recording, or if no separate values explain enough of the residual.
    """
    problem, samples = found.problem, found.problem.samples
    shared = [n for n in found.free if not problem.parameter(n).per_record]
    alone = len(problem.records) < 2 or not shared
    if alone or not above_noise(found.cost, samples, policy):
        return None
    number, heat = len(problem.records) - 1, found.cost / samples
    chance = policy.false_alarms / len(shared)
    least = heat * max(number * math.log(samples), float(chi2.isf(chance, number)))
    halves = blocks_of(problem, found.point, 2, found.free)
    gains = {name: _gain(halves, name) for name in shared}
    promising = sorted(shared, key=lambda name: -gains[name])[: policy.followed]
    best, share = None, policy.separate_gain
    for name in promising:
        if gains[name] > least and _foretold(halves, name) > 0:
            one = _separated(found, name, policy, share)
            if one.share >= share:
                best, share = one._replace(terms=terms), one.share
    return best


def _separated(found: Fit, name: str, policy: Policy, least: float) -> Differing:
    """Fit a parameter with a separate value for each recording.

    **Arguments:** `least`: the share of the residual that the separate values must
    explain; a fit that does not reach this share soon enough is stopped.
    """
    problem = found.problem
    excess = found.cost - problem.samples
    beaten = found.cost - least * excess
    parameters = tuple(
        dataclasses.replace(one, per_record=True) if one.name == name else one
        for one in problem.parameters
    )
    again = fit(
        dataclasses.replace(problem, parameters=parameters),
        free=found.free,
        start=found.point,
        iterations=policy.iterations,
        stop=given_up(problem.samples, policy, beaten, beaten),
    )
    own = [one for one in again.estimates if one.name == name]
    return Differing(
        name,
        problem.parameter(name).unit,
        problem.records,
        np.array([one.value for one in own]),
        np.array([one.stderr for one in own]),
        min(1.0, (found.cost - again.cost) / excess),
        rms_of(again),
        not above_noise(again.cost, problem.samples, policy),
        found.cost - again.cost,
        again,
    )


def _split(blocks: Blocks, name: str) -> Blocks:
    """Return blocks in which a parameter has a separate column for each recording."""
    (place,) = blocks.rows([name])
    records = list(dict.fromkeys(blocks.record))
    others = np.setdiff1d(np.arange(len(blocks.names)), [place])
    size, count = len(others) + len(records), len(blocks.record)
    information, score = np.zeros((count, size, size)), np.zeros((count, size))
    for b, record in enumerate(blocks.record):
        columns = np.append(np.arange(len(others)), len(others) + records.index(record))
        source = np.append(others, place)
        information[b][np.ix_(columns, columns)] = blocks.information[b][
            np.ix_(source, source)
        ]
        score[b, columns] = blocks.score[b, source]
    again = np.append(others, np.full(len(records), place))
    owner = np.append(blocks.owner[others], np.arange(len(records)))
    return dataclasses.replace(
        blocks,
        names=tuple(blocks.names[k] for k in again),
        scale=blocks.scale[again],
        information=information,
        score=score,
        prior=blocks.prior[again],
        pull=blocks.pull[again],
        owner=owner,
    )


def _gain(halves: Blocks, name: str) -> float:
    """Return the predicted gain of separate values compared with a common value."""
    return _best(_split(halves, name)) - _best(halves)


def _best(blocks: Blocks) -> float:
    information, score = blocks.total()
    return gain(information, score, np.arange(len(score)))


def _foretold(halves: Blocks, name: str) -> float:
    """Return the gain of separate values compared with a common value, with the values
    estimated from one half of each recording and used in the other half.
    """
    return _crossed(_split(halves, name)) - _crossed(halves)


def _crossed(blocks: Blocks) -> float:
    starts = np.asarray(blocks.start)
    later, found = starts > starts.min(), 0.0
    for fitted in (later, ~later):
        information, score = blocks.total(fitted.astype(float))
        rows = np.arange(len(score))
        step, _ = newton_step(information, score, rows)
        unseen = (~fitted).astype(float)
        curvature = np.einsum("b,bij->ij", unseen, blocks.information)
        slope = np.einsum("b,bi->i", unseen, blocks.score)
        found += float(2 * slope @ step - step @ curvature @ step)
    return found
