"""At which frequency the flights are shaken: a periodogram of what a fit leaves over.

A force `a sin(w t) + b cos(w t)` moves a body in flight by the same over `-w^2`, beside
a motion that the initial state of each flight and the forces on it take up: a cubic in
time. That motion is taken out of the residuals and of the oscillations alike, flight by
flight; what is left is regressed with one phase for all records.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..fitting import Residuals


# Degree of the motion that a flight's initial state and its forces explain
_DEGREE = 3
# Samples a period at the highest frequency, before and after neighbours are averaged
_PER_PERIOD = 20
_JOINED = 4
# Frequencies a resolution cell (one over the length of a record)
_FINE = 6


@dataclasses.dataclass(frozen=True)
class Periodogram:
    """Growth of twice the log-likelihood at each `frequency` (Hz), shape `(k,)`.

    `gain` with one phase for all records, `separate` with a phase for each record.
    `records` is their number, `cells` that of frequencies that can be told apart.
    """

    frequency: Float[np.ndarray, " k"]
    gain: Float[np.ndarray, " k"]
    separate: Float[np.ndarray, " k"]
    records: int

    @property
    def best(self) -> tuple[float, float]:
        """Frequency (Hz) and gain of the highest peak with one phase."""
        k = int(np.argmax(self.gain))
        return float(self.frequency[k]), float(self.gain[k])

    @property
    def best_separate(self) -> tuple[float, float]:
        """Frequency (Hz) and gain of the highest peak with separate phases."""
        k = int(np.argmax(self.separate))
        return float(self.frequency[k]), float(self.separate[k])

    @property
    def cells(self) -> int:
        return max(1, len(self.frequency) // _FINE)


def periodogram(parts: Sequence[Residuals]) -> Periodogram:
    """Scan all frequencies that the flights can show.

    **Arguments:** residuals of the channels that see the position.
    """
    values, times, edges, bases, firsts = [], [], [], [], []
    count = 0
    for part in parts:
        fly, first = ~part.resting, True
        for flight in np.unique(part.flight[fly]):
            rows = np.flatnonzero(fly & (part.flight == flight))
            if len(rows) < 4 * _JOINED * (_DEGREE + 1):
                continue
            if first:
                firsts.append(len(edges))
            first = False
            number = len(rows) // _JOINED
            rows = rows[: number * _JOINED].reshape(number, _JOINED)
            t = part.time[rows].mean(axis=1)
            x = (t - t.mean()) / np.ptp(t)
            basis, _ = np.linalg.qr(np.vander(x, _DEGREE + 1))
            value = part.value[rows].mean(axis=1) / part.noise * math.sqrt(_JOINED)
            values.append(value - basis @ (basis.T @ value))
            times.append(t)
            bases.append(basis)
            edges.append(count)
            count += number
    if not values:
        none = np.zeros(1)
        return Periodogram(none, none, none, 1)
    value, time = np.concatenate(values), np.concatenate(times)
    basis, cuts = np.concatenate(bases), np.array(edges)
    records = np.array(firsts)
    interval = float(np.median(np.diff(times[0]))) / _JOINED
    length = max(float(np.max(p.time) - np.min(p.time)) for p in parts)
    flight = float(np.median([np.ptp(t) for t in times]))
    step = 1 / (_FINE * length)
    frequency = np.arange(1 / flight, 1 / (_PER_PERIOD * interval), step)
    turn: np.ndarray = np.exp(2j * np.pi * frequency[0] * time)
    advance = np.exp(2j * np.pi * step * time)
    gain, separate = np.zeros(len(frequency)), np.zeros(len(frequency))
    starts = cuts[records]
    for k in range(len(frequency)):
        taken: np.ndarray = np.add.reduceat(basis * turn[:, None], cuts, axis=0)

        def summed(a, b, projected):
            whole = np.add.reduceat(a * b, starts)
            return whole - np.add.reduceat(projected.sum(axis=1), records)

        re, im = np.real(turn), np.imag(turn)
        tr, ti = np.real(taken), np.imag(taken)
        cc, ss = summed(re, re, tr * tr), summed(im, im, ti * ti)
        cs = summed(re, im, tr * ti)
        c, s = np.add.reduceat(value * re, starts), np.add.reduceat(value * im, starts)
        gain[k] = _solved(*(np.sum(x, keepdims=True) for x in (cc, ss, cs, c, s)))[0]
        separate[k] = np.sum(_solved(cc, ss, cs, c, s))
        turn = turn * advance
    return Periodogram(frequency, gain, separate, len(records))


def _solved(cc, ss, cs, c, s):
    """Gains of cosine and sine together."""
    det = cc * ss - cs * cs
    # what the cubics take up entirely cannot be seen
    seen = det > 1e-9 * np.maximum(cc, ss) ** 2
    top = ss * c * c - 2 * cs * c * s + cc * s * s
    return np.where(seen, top / np.where(seen, det, 1.0), 0.0)
