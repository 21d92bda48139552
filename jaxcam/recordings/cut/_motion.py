"""One channel of a recording and the surface below it."""

import dataclasses

import numpy as np
from jaxtyping import Float

from ._gap_rate import GapRate
from ._kinks import find_kinks, WINDOW
from ._polynomial import fit_local, LocalFit, usual_degree


# Usual length (s) of the stretch that is fitted, and its minimum number of samples
_FIT_WINDOW, _FEWEST = 0.1, 16
# Number of samples in the longest stretch below which a higher degree is tried before
# the stretch is shortened: its highest degree, and minimum number of samples per
# coefficient
_MANY, _HIGHEST, _PER_COEFFICIENT = 100, 5, 2
# Rms residual (in units of the noise) above which a polynomial does not follow a
# stretch
_FOLLOWED = 2.0
# Coefficient of the next power, in standard errors, above which a polynomial does not
# follow the stretch either
_NEXT = 2.0


@dataclasses.dataclass(frozen=True)
class Motion:
    """Samples of a motion, the values that they would have in contact, and their noise.

    The motion is above the surface; `sense` is -1 if it was `mirrored` to achieve this.
    `seen` is the rate of change of the gap, if it is measured.
    """

    time: Float[np.ndarray, " k"]
    samples: Float[np.ndarray, " k"]
    contact: Float[np.ndarray, " k"]
    rate: Float[np.ndarray, " k"]
    noise: float
    interval: float
    sense: float = 1.0
    seen: GapRate | None = None

    def mirrored(self, contact, rate) -> "Motion":
        """Return the motion relative to a surface above it, with position `contact` and
        velocity `rate`, both `(k,)` in the units of the samples.
        """
        return dataclasses.replace(
            self, samples=-self.samples, contact=-contact, rate=-rate, sense=-1.0
        )

    @property
    def gap(self) -> Float[np.ndarray, " k"]:
        return self.samples - self.contact

    def jumps(self) -> list[int]:
        """Return the index of the first sample after each jump in velocity: those that
        the measured rate shows, and those that only the samples show.
        """
        kinks = find_kinks(self.samples, self.interval, self.noise).tolist()
        if self.seen is None:
            return kinks
        shown = self.seen.jumps
        reach = max(6, round(WINDOW / self.interval))
        others = [k for k in kinks if not np.any(np.abs(shown - k) <= reach)]
        return sorted([*shown.tolist(), *others])

    def fit(self, first: int, last: int, *, at_end: bool) -> LocalFit:
        """Fit a polynomial to one end of a flight, as far as it can follow the motion.

        A polynomial that does not follow the motion has the wrong slope at the end.
        Therefore a stretch with many samples is shortened; one with few samples cannot
        be shortened enough, and the degree is raised first.
        """
        # the samples next to an impact may belong to the other side
        inner = slice(first + 1, last - 1) if last - first > 6 else slice(first, last)
        count = max(_FEWEST, round(_FIT_WINDOW / self.interval))
        few = count < _MANY
        every = np.arange(len(self.time))[inner]
        origin = float(self.time[min(last, len(self.time) - 1) if at_end else first])
        while True:
            rows = every[-count:] if at_end else every[:count]
            time, samples = self.time[rows], self.samples[rows]
            usual = usual_degree(len(rows))
            most = min(_HIGHEST if few else 3, len(rows) // _PER_COEFFICIENT - 1)
            for degree in range(usual, max(usual, most) + 1):
                found = fit_local(time, samples, self.noise, origin, degree)
                if self._follows(found, time, samples):
                    return found
            count = round(0.7 * len(rows))
            if count < _FEWEST:
                return found

    def _follows(self, fit: LocalFit, time, samples) -> bool:
        """Return whether a fit describes the samples, and a further power would not
        improve it. The omission of a significant power would mainly distort the slope
        at the end.
        """
        off = samples - fit.values(time)
        degree = len(fit.coefficients)
        if degree >= len(time):
            return True
        free = len(time) - degree
        scale = max(float(np.max(np.abs(time - fit.origin))), np.finfo(float).tiny)
        powers = ((time - fit.origin) / scale)[:, None] ** np.arange(degree + 1)
        # the part of the residuals that the next power of time would describe
        added = np.linalg.qr(powers)[0][:, -1]
        if abs(float(added @ off)) > _NEXT * self.noise:
            return False
        return float(np.sum(off**2)) <= (_FOLLOWED * self.noise) ** 2 * free
