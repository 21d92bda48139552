"""Find impacts that the segmentation missed, with a model of the flights."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from ..recordings.cut import Segments
from ._fit import fit
from .engine import Model, Parameter, Problem, separated


# A piece is searched for an impact if its cost per sample exceeds both this limit and
# this multiple of the upper quartile over all pieces; the second condition allows for a
# model that fits no piece well
_COST, _UNUSUAL = 3.0, 3.0
_QUARTILE = 0.75
# An impact is accepted if it explains at least this fraction of the excess cost
_EXPLAINED = 0.5
# Fraction required instead if another impact is closer than this time (s), because a
# soft contact may bend the motion there
_COMPLETELY, _NEAR = 0.99, 0.01
# Maximum number of iterations of a fit, which need not converge
_STEPS = 12
# Number of rounds; each finds at most one impact in a piece
_ROUNDS = 4

Spans: TypeAlias = tuple[tuple[float, float], ...]


class _Misfits(NamedTuple):
    """The pieces of one recording: start and end (s), and the excess of the cost over
    its expected value, in total and per sample.
    """

    start: Float[np.ndarray, " k"]
    stop: Float[np.ndarray, " k"]
    excess: Float[np.ndarray, " k"]
    share: Float[np.ndarray, " k"]


def with_missed_impacts(
    model: Model,
    parameters: Sequence[Parameter],
    segments: Sequence[Segments],
    again: Callable[[Sequence[Spans]], tuple[Segments, ...]],
) -> tuple[Segments, ...]:
    """Return the segments, supplemented by impacts that the segmentation missed.

    If the model describes most pieces of flight but not a particular one, that piece
    may contain an impact. An impact found there is accepted if it explains most of the
    excess cost.

    **Arguments:** `again` is a function that repeats the segmentation and searches the
    given time spans (s) of each recording for impacts.
    """
    segments = tuple(segments)
    accepted: list[Spans] = [() for _ in segments]
    refused: list[Spans] = [() for _ in segments]
    before = _misfits(model, parameters, segments)
    for _ in range(_ROUNDS):
        if before is None:
            break
        fresh = [
            tuple(span for span in spans if span not in old)
            for spans, old in zip(_doubted(before), refused)
        ]
        if not any(fresh):
            break
        found = again([a + b for a, b in zip(accepted, fresh)])
        after = _misfits(model, parameters, found)
        if after is None:
            break
        good = [
            tuple(span for span in spans if _explained(span, old, new, part))
            for spans, old, new, part in zip(fresh, before, after, found)
        ]
        accepted = [a + b for a, b in zip(accepted, good)]
        bad = [tuple(s for s in a if s not in b) for a, b in zip(fresh, good)]
        refused = [a + b for a, b in zip(refused, bad)]
        if good == fresh:
            segments, before = found, after
        elif any(good):
            segments = again(accepted)
            before = _misfits(model, parameters, segments)
    return segments


def _misfits(model, parameters, segments) -> list[_Misfits] | None:
    """Fit each piece separately, with parameters common to all pieces, and return the
    misfits of each recording, or None if the recordings cannot be fitted.
    """
    try:
        problem = Problem.build(model, segments, parameters)
    except ValueError:
        # a later fit of these recordings reports the reason
        return None
    problem = dataclasses.replace(problem, extras=separated(problem.extras))
    pieces = problem.pieces
    fitted = fit(problem, iterations=_STEPS, stop=lambda costs: False)
    costs = np.asarray(fitted.costs.flown)
    known = np.asarray(pieces.flown.known)
    counts = np.sum(known, axis=(-3, -2, -1))
    start, step = np.asarray(pieces.flown.start), np.asarray(pieces.flown.step)
    stop = start + step * known.shape[2]
    found = []
    for row, used in enumerate(np.asarray(pieces.exists) & (counts > 0)):
        excess = np.nan_to_num(costs[row] - counts[row], posinf=0.0)[used]
        share = excess / counts[row][used]
        found.append(_Misfits(start[row][used], stop[row][used], excess, share))
    return found


def _doubted(misfits: Sequence[_Misfits]) -> list[Spans]:
    """Return the time spans of pieces with an unusual misfit; adjacent pieces are
    joined.
    """
    shares = np.concatenate([one.share for one in misfits])
    usual = 1 + max(0.0, float(np.quantile(shares, _QUARTILE))) if len(shares) else 1.0
    limit = max(_COST, _UNUSUAL * usual) - 1
    found = []
    for one in misfits:
        spans: list[tuple[float, float]] = []
        for k in np.flatnonzero(one.share > limit):
            start, stop = float(one.start[k]), float(one.stop[k])
            if spans and k and one.share[k - 1] > limit:
                start = spans.pop()[0]
            spans.append((start, stop))
        found.append(tuple(spans))
    return found


def _explained(
    span: tuple[float, float], before: _Misfits, after: _Misfits, part: Segments
) -> bool:
    """Return whether impacts found in a span explain its excess cost."""
    bounds = [one for flight in part.flights for one in (flight.start, flight.stop)]
    times = np.unique([one.time for one in bounds if one.kind != "end of record"])
    inside = (times > span[0]) & (times < span[1])
    near = np.any(np.diff(times)[inside[1:] | inside[:-1]] < _NEAR)
    part_explained = _COMPLETELY if near else _EXPLAINED

    def excess(misfits: _Misfits) -> float:
        here = (misfits.stop > span[0]) & (misfits.start < span[1])
        return float(np.sum(misfits.excess[here]))

    return excess(after) < (1 - part_explained) * excess(before)
