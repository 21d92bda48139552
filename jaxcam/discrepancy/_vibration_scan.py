"""At which frequency the flights are shaken: what a force at each would gain.

A vibration too weak to be seen in the samples of a flight still decides how fast it
ends, and so the impact and the next flight. So the scan uses the whole likelihood,
impacts included, with the states and the free parameters eliminated: exactly the gain
that a fit with that frequency promises.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from ..fitting import Problem
from ..fitting._fit import invert
from ..fitting._linearise import Point
from ._local_force import force_response, Response


# Frequencies a resolution cell (one over the length of a record)
_FINE = 4
# Periods in a record at the lowest frequency
_LEAST = 4.0
# Samples a period, and steps of the flights a period, at the highest frequency
_SAMPLES, _STEPS = 20.0, 2.5


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


def periodogram(problem: Problem, point: Point, free: tuple[str, ...]) -> Periodogram:
    """Scan all frequencies that the flights can show, about a point.

    **Arguments:** a problem whose system is a `WithTerms`, and the names of the
    parameters that are free beside the vibration.
    """
    response = force_response(problem, point, free)
    frequency = _frequencies(problem)
    if not len(frequency):
        none = np.zeros(1)
        return Periodogram(none, none, none, 1)
    rate = 2 * np.pi * frequency
    size = len(response.prior)
    information, score = np.diag(response.prior), response.pull.copy()
    records = []
    for r in range(len(response.exists)):
        found = _reduced(response, r, rate)
        used = np.flatnonzero(response.place[r] >= 0)
        rows = response.place[r][used]
        information[np.ix_(rows, rows)] += found.pp[np.ix_(used, used)]
        score[rows] += found.p[used]
        across = np.zeros((size, len(rate)), dtype=complex)
        across[rows] = found.pf[used]
        records.append(found._replace(pf=across))
    inside = invert(information)
    inside = np.where(np.isfinite(inside), inside, 0.0)
    whole = [sum(part) for part in zip(*(r[2:] for r in records))]
    gain = _gain(inside, score, [whole])
    separate = _gain(inside, score, [r[2:] for r in records])
    return Periodogram(frequency, gain, separate, len(records))


def _frequencies(problem: Problem) -> Float[np.ndarray, " k"]:
    length = max(part.recording.duration for part in problem.segments)
    interval = max(part.recording.interval for part in problem.segments)
    exists = np.asarray(problem.pieces.exists)
    step = float(np.max(np.asarray(problem.pieces.flown.step)[exists]))
    top = min(1 / (_SAMPLES * interval), 1 / (_STEPS * step))
    return np.arange(_LEAST / length, top, 1 / (_FINE * length))


class _Reduced(NamedTuple):
    """Of one record, its states eliminated, for a force `exp(i w t)` at each rate.

    `pp`, `p` of the parameters; `pf` couples them to the force; `f` is its score,
    `ff` the sum of squares of its rows and `fc` that of their absolute squares.
    """

    pp: Float[np.ndarray, "m m"]
    p: Float[np.ndarray, " m"]
    pf: Complex[np.ndarray, "m w"]
    f: Complex[np.ndarray, " w"]
    ff: Complex[np.ndarray, " w"]
    fc: Float[np.ndarray, " w"]


def _reduced(response: Response, r: int, rate) -> _Reduced:
    """The chain of pieces of one record from its first to its last."""
    found = response.pieces
    n = found.later.shape[-1]
    m = response.place.shape[1]
    p, l = slice(n, n + m), slice(n + m, None)
    pp, ps = found.pp[r, :m, :m].copy(), found.p[r, :m].copy()
    pf = np.zeros((m, len(rate)), dtype=complex)
    f, ff = np.zeros((2, len(rate)), dtype=complex)
    fc = np.zeros(len(rate))

    def add(rows_p, rows_f, sign=1.0):
        """Products of columns for the parameters, one, and the force."""
        nonlocal pp, ps, pf, f, ff, fc
        (a, one), (b, other) = rows_p, rows_f
        pp, ps = pp + sign * a.T @ a, ps + sign * a.T @ one
        pf, f = pf + sign * a.T @ b, f + sign * other @ b
        ff, fc = ff + sign * np.sum(b * b, axis=0), fc + sign * np.sum(_square(b), 0)

    before, waves_before = None, None
    for k in np.flatnonzero(response.exists[r]):
        inner, slope = found.information[r, k], found.slope[r, k]
        waves = _waves(response.time[r, k], rate)
        shaken = inner[:, l] @ waves
        pp, ps = pp + inner[p, p], ps + slope[p]
        pf, f = pf + shaken[p], f + slope[l] @ waves
        ff = ff + np.sum(waves * shaken[l], axis=0)
        fc = fc + np.sum(np.real(np.conj(waves) * shaken[l]), axis=0)
        here = [inner[:n, :n], inner[:n, p], slope[:n], shaken[:n]]
        if before is not None:
            later, off = found.later[r, k], -found.tied[r, k]
            earlier = found.earlier[r, k]
            direct = earlier[:, p] + found.direct[r, k, :, :m]
            pushed = earlier[:, l] @ waves_before
            add((direct, off), (pushed, off))
            sides = [later, direct, off, pushed]
            here = [x + later.T @ y for x, y in zip(here, sides)]
            sides[0] = earlier[:, :n]
            before = [x + sides[0].T @ y for x, y in zip(before, sides)]
            half, coupled = _halved(before, sides[0].T @ later)
            add((half[1], half[2]), (half[3], half[2]), -1.0)
            here = [x - coupled.T @ y for x, y in zip(here, (coupled, *half[1:]))]
        before, waves_before = here, waves
    if before is not None:
        half, _ = _halved(before, np.zeros((n, 0)))
        add((half[1], half[2]), (half[3], half[2]), -1.0)
    return _Reduced(pp, ps, pf, f, ff, fc)


def _halved(blocks, coupling):
    """Blocks of one piece, and its coupling to the next, over the root of the first."""
    scale = 1 / np.sqrt(np.maximum(np.diag(blocks[0]), 1e-300))
    scaled = blocks[0] * np.outer(scale, scale)
    root = np.linalg.inv(np.linalg.cholesky(scaled + 1e-13 * np.eye(len(scale))))
    root = root * scale
    return [root @ part for part in blocks], root @ coupling


def _waves(time, rate) -> Complex[np.ndarray, "l w"]:
    """`exp(i w t)` at evenly spaced times."""
    found = np.empty((len(time), len(rate)), dtype=complex)
    found[0] = np.exp(1j * rate * time[0])
    turn = np.exp(1j * rate * (time[1] - time[0]))
    for k in range(1, len(time)):
        np.multiply(found[k - 1], turn, out=found[k])
    return found


def _square(values):
    return values.real**2 + values.imag**2


def _gain(inside, score, parts) -> Float[np.ndarray, " w"]:
    """Gain of a cosine and a sine for each part, the parameters eliminated."""
    across, scores, own = [], [], []
    for pf, f, ff, fc in parts:
        across += [pf.real, pf.imag]
        scores += [f.real, f.imag]
        cc, ss, cs = (fc + ff.real) / 2, (fc - ff.real) / 2, ff.imag / 2
        own.append(np.array([[cc, cs], [cs, ss]]))
    c = np.moveaxis(np.array(across), -1, 0)
    width = c.shape[1]
    taken = c @ inside
    left = np.array(scores).T - taken @ score
    matrix = -taken @ np.swapaxes(c, 1, 2)
    for k, block in enumerate(own):
        pick = slice(2 * k, 2 * k + 2)
        matrix[:, pick, pick] += np.moveaxis(block, -1, 0)
    scale = 1 / np.sqrt(np.maximum(np.einsum("wii->wi", matrix), 1e-300))
    matrix = matrix * scale[:, :, None] * scale[:, None, :]
    left = left * scale
    solved = np.linalg.solve(matrix + 1e-9 * np.eye(width), left[..., None])[..., 0]
    return np.sum(left * solved, axis=-1)
