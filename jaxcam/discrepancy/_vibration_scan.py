"""At which frequency the flights are shaken: a periodogram of what a fit leaves over.

A force `a sin(w t) + b cos(w t)` moves a body in flight by the same over `-w^2`, beside
a motion that the initial state of each flight and the forces on it take up: a cubic in
time. That motion is taken out of the residuals and of the oscillations alike, flight by
flight; what is left is regressed with one phase for all records.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..fitting import Residuals


# Degree of the motion that a flight's initial state and its forces explain
_DEGREE = 3
# Samples a period at the highest frequency
_PER_PERIOD = 20
# Frequencies a resolution cell (one over the length of a record)
_FINE = 6


@dataclasses.dataclass(frozen=True)
class Periodogram:
    """`gain` `(k,)`: growth of twice the log-likelihood at each `frequency` (Hz)."""

    frequency: Float[np.ndarray, " k"]
    gain: Float[np.ndarray, " k"]

    @property
    def best(self) -> tuple[float, float]:
        """Frequency (Hz) and gain of the highest peak."""
        k = int(np.argmax(self.gain))
        return float(self.frequency[k]), float(self.gain[k])


def periodogram(parts: Sequence[Residuals]) -> Periodogram:
    """Scan all frequencies that the flights can show.

    **Arguments:** residuals of the channels that see the position.
    """
    values, times, edges, bases = [], [], [], []
    count = 0
    for part in parts:
        fly = ~part.resting
        for flight in np.unique(part.flight[fly]):
            rows = np.flatnonzero(fly & (part.flight == flight))
            if len(rows) < 4 * (_DEGREE + 1):
                continue
            t = part.time[rows]
            x = (t - t.mean()) / np.ptp(t)
            basis, _ = np.linalg.qr(np.vander(x, _DEGREE + 1))
            value = part.value[rows] / part.noise
            values.append(value - basis @ (basis.T @ value))
            times.append(t)
            bases.append(basis)
            edges.append(count)
            count += len(rows)
    if not values:
        return Periodogram(np.zeros(1), np.zeros(1))
    value, time = np.concatenate(values), np.concatenate(times)
    basis, edges = np.concatenate(bases), np.array(edges)
    interval = float(np.median(np.diff(times[0])))
    length = max(float(np.max(p.time) - np.min(p.time)) for p in parts)
    flight = float(np.median([np.ptp(t) for t in times]))
    step = 1 / (_FINE * length)
    frequency = np.arange(1 / flight, 1 / (_PER_PERIOD * interval), step)
    turn = np.exp(2j * np.pi * frequency[0] * time)
    advance = np.exp(2j * np.pi * step * time)
    gain = np.zeros(len(frequency))
    for k in range(len(frequency)):
        gain[k] = _regressed(value, turn, basis, edges)
        turn = turn * advance
    return Periodogram(frequency, gain)


def _regressed(value, turn, basis, edges) -> float:
    """Gain of cosine and sine together, each without what the flights explain."""
    taken = np.add.reduceat(basis * turn[:, None], edges, axis=0)
    real, imag = taken.real.ravel(), taken.imag.ravel()
    cc = np.dot(turn.real, turn.real) - np.dot(real, real)
    ss = np.dot(turn.imag, turn.imag) - np.dot(imag, imag)
    cs = np.dot(turn.real, turn.imag) - np.dot(real, imag)
    c, s = np.dot(value, turn.real), np.dot(value, turn.imag)
    det = cc * ss - cs * cs
    # what the cubics take up entirely cannot be seen
    if not det > 1e-9 * max(cc, ss) ** 2:
        return 0.0
    return float((ss * c * c - 2 * cs * c * s + cc * s * s) / det)
