"""Scan frequencies for a vibration: predict the gain of a harmonic force at each.

A vibration too weak to be visible in the samples of a flight still affects the approach
speed, and thus the impact and the next flight. The scan therefore uses the complete
likelihood, including impacts, with the states and the free parameters eliminated. The
result is the predicted gain of a fit with that frequency.
"""

import dataclasses
from typing import Any

import jax
import numpy as np
from jaxtyping import Complex, Float

from ...fitting import Problem
from ...fitting.engine import invert_information
from ..policy import Policy
from ._local_force import Response, stride_of
from ._state_elimination import StateElimination, TINY


# Relative increase of a diagonal that keeps a matrix positive definite
_SHAKEN = 1e-9


@dataclasses.dataclass(frozen=True)
class Periodogram:
    """Gain in twice the log-likelihood at each `frequency` (Hz), shape `(k,)`.

    `gain` is for one phase in all recordings, `separate` for a separate phase in each
    recording. `records` is their number, `cells` the number of distinguishable
    frequencies (each has several grid points); `elsewhere` is the gain of the highest
    separate peak without the recording in which it gains most. Frequencies below
    `lowest` (Hz) only show whether the gain has a peak above it: a gain that falls from
    there on belongs to a slower change, which is not a vibration.
    """

    frequency: Float[np.ndarray, " k"]
    gain: Float[np.ndarray, " k"]
    separate: Float[np.ndarray, " k"]
    records: int
    cells: int = 1
    elsewhere: float = 0.0
    lowest: float = 0.0

    @property
    def best(self) -> tuple[float, float]:
        """Frequency (Hz) and gain of the highest peak with one phase."""
        return _highest(self.frequency, self.gain, self.lowest)

    @property
    def best_separate(self) -> tuple[float, float]:
        """Frequency (Hz) and gain of the highest peak with separate phases."""
        return _highest(self.frequency, self.separate, self.lowest)


def _highest(frequency, gain, lowest: float) -> tuple[float, float]:
    """Return frequency and gain of the highest peak; a gain of zero if there is none.

    A peak is a local maximum, or the highest frequency.
    """
    before, after = gain[:-1], np.append(gain[2:], -np.inf)
    peak = (gain[1:] >= before) & (gain[1:] >= after) & (frequency[1:] >= lowest)
    if not np.any(peak):
        return float(frequency[-1]), 0.0
    k = 1 + int(np.argmax(np.where(peak, gain[1:], -np.inf)))
    return float(frequency[k]), float(gain[k])


def periodogram(problem: Problem, response: Response, policy: Policy) -> Periodogram:
    """Scan all frequencies that the flights can resolve.

    **Arguments:** the problem, and its `Response` about a fit.
    """
    frequency = scanned_frequencies(problem, policy)
    if not len(frequency):
        none = np.zeros(1)
        return Periodogram(none, none, none, 1)
    # one period below, to see whether the gain has a peak
    lowest, grid = float(frequency[0]), policy.frequency_grid
    below = lowest - np.arange(grid, 0, -1) / (grid * _longest(problem))
    below = below[below > 0]
    frequency = np.concatenate([below, frequency])
    rate = 2 * np.pi * frequency
    size = len(response.prior)
    information, score = np.diag(response.prior), response.pull.copy()
    parts = []
    for r, place in enumerate(response.place):
        sums = _summed(response, r, rate)
        used = np.flatnonzero(place >= 0)
        rows = place[used]
        information[np.ix_(rows, rows)] += sums.pp[np.ix_(used, used)]
        score[rows] += sums.p[used]
        across = np.zeros((size, len(rate)), dtype=complex)
        across[rows] = sums.pf[used]
        parts.append((across, sums.f, sums.ff, sums.fc))
    inside = invert_information(information)
    inside = np.where(np.isfinite(inside), inside, 0.0)
    whole = tuple(sum(part) for part in zip(*parts))
    gain = _gain(inside, score, [whole])
    separate = _gain(inside, score, parts)
    peak_at, _ = _highest(frequency, separate, lowest)
    top = [int(np.searchsorted(frequency, peak_at))]
    peak = [tuple(one[..., top] for one in part) for part in parts]
    rest = [_gain(inside, score, peak[:r] + peak[r + 1 :])[0] for r in range(len(peak))]
    elsewhere = min(rest) if len(peak) > 1 else 0.0
    cells = max(1, (len(frequency) - len(below)) // grid)
    found = frequency, gain, separate
    return Periodogram(*found, len(parts), cells, float(elsewhere), lowest)


def scanned_frequencies(problem: Problem, policy: Policy) -> Float[np.ndarray, " k"]:
    """Return frequencies from a few periods in the longest recording up to the highest
    that samples and integration steps resolve.
    """
    length = _longest(problem)
    interval = max(part.recording.interval for part in problem.segments)
    exists = np.asarray(problem.pieces.exists)
    step = float(np.max(np.asarray(problem.pieces.flown.step)[exists]))
    step *= stride_of(problem)
    top = min(1 / (policy.period_samples * interval), 1 / (policy.period_steps * step))
    grid = 1 / (policy.frequency_grid * length)
    return np.arange(policy.fewest_periods / length, top, grid)


def _longest(problem: Problem) -> float:
    """Return the duration of the longest recording (s)."""
    return max(part.recording.duration for part in problem.segments)


class _Sums:
    """Sums over the pieces of one recording for a force `exp(i w t)` at each frequency.

    `pp` and `p` are information and score of the parameters; `pf` couples them to the
    force. For the force, `f` is the score, `ff` the sum of the squares of its rows, and
    `fc` the sum of their absolute squares.
    """

    def __init__(self, pp, p, rates: int):
        self.pp, self.p = np.array(pp), np.array(p)
        self.pf = np.zeros((len(p), rates), dtype=complex)
        self.f, self.ff = np.zeros((2, rates), dtype=complex)
        self.fc = np.zeros(rates)

    def add_piece(self, inner, slope, waves, shaken):
        """Add one piece; the rows of the information `inner` and score `slope` belong
        to the parameters, then to the nodes of the piece.
        """
        m = len(self.p)
        self.pp += inner[:m, :m]
        self.p += slope[:m]
        self.pf += shaken[:m]
        self.f += slope[m:] @ waves
        self.ff += np.sum(waves * shaken[m:], axis=0)
        self.fc += np.sum(np.real(np.conj(waves) * shaken[m:]), axis=0)

    def add(self, direct, pushed, off, sign):
        """Add rows: their derivatives with respect to the parameters (`direct`) and the
        force (`pushed`), and their residuals (`off`).
        """
        self.pp += sign * direct.T @ direct
        self.p += sign * direct.T @ off
        self.pf += sign * direct.T @ pushed
        self.f += sign * off @ pushed
        self.ff += sign * np.sum(pushed * pushed, axis=0)
        self.fc += sign * np.sum(pushed.real**2 + pushed.imag**2, axis=0)


def _summed(response: Response, r: int, rate) -> _Sums:
    """Eliminate the states of one recording, from the first piece to the last."""
    found: Any = jax.tree.map(lambda part: part[r], response.pieces)
    n, m = found.later.shape[-1], response.place.shape[1]
    p, l = slice(n, n + m), slice(n + m, None)
    sums = _Sums(found.pp[:m, :m], found.p[:m], len(rate))
    states, waves_before = StateElimination(sums.add), None
    for k in np.flatnonzero(response.exists[r]):
        inner, slope = found.information[k], found.slope[k]
        waves = _waves(response.time[r, k], rate)
        shaken = inner[:, l] @ waves
        sums.add_piece(inner[n:, n:], slope[n:], waves, shaken[n:])
        # the blocks of the state: its information with itself and with the parameters,
        # its score, and its information with the force
        here = [inner[:n, :n], inner[:n, p], slope[:n], shaken[:n]]
        if waves_before is None:
            states.begin(here)
        else:
            earlier = found.earlier[k]
            direct = earlier[:, p] + found.direct[k, :, :m]
            rows = direct, -found.tied[k], earlier[:, l] @ waves_before
            states.follow(here, earlier[:, :n], found.later[k], rows)
        waves_before = waves
    states.end()
    return sums


def _waves(time, rate) -> Complex[np.ndarray, "l w"]:
    """Return `exp(i w t)` at equidistant times."""
    found = np.empty((len(time), len(rate)), dtype=complex)
    found[0] = np.exp(1j * rate * time[0])
    turn = np.exp(1j * rate * (time[1] - time[0]))
    for k in range(1, len(time)):
        np.multiply(found[k - 1], turn, out=found[k])
    return found


def _gain(inside, score, parts) -> Float[np.ndarray, " w"]:
    """Return the gain of a cosine and a sine for each part, with the parameters
    eliminated.
    """
    across, scores, blocks = [], [], []
    for pf, f, ff, fc in parts:
        across += [pf.real, pf.imag]
        scores += [f.real, f.imag]
        cc, ss, cs = (fc + ff.real) / 2, (fc - ff.real) / 2, ff.imag / 2
        blocks.append(np.array([[cc, cs], [cs, ss]]))
    c = np.moveaxis(np.array(across), -1, 0)
    width = c.shape[1]
    taken = c @ inside
    left = np.array(scores).T - taken @ score
    matrix = -taken @ np.swapaxes(c, 1, 2)
    for k, block in enumerate(blocks):
        pick = slice(2 * k, 2 * k + 2)
        matrix[:, pick, pick] += np.moveaxis(block, -1, 0)
    own = np.einsum("wii->wi", matrix)
    # a force that the parameters represent to within rounding gains nothing
    scale = np.where(own > 0, 1 / np.sqrt(np.maximum(own, TINY)), 0.0)
    matrix = matrix * scale[:, :, None] * scale[:, None, :]
    left = left * scale
    solved = np.linalg.solve(matrix + _SHAKEN * np.eye(width), left[..., None])[..., 0]
    return np.sum(left * solved, axis=-1)
