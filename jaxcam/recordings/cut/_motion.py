"""One channel of a record, and the surface below it."""

import dataclasses

import numpy as np
from jaxtyping import Float

from ._polynomial import fit_local, LocalFit


# Longest stretch (s) that a cubic follows within the noise of a good encoder
_FIT_WINDOW = 0.1


@dataclasses.dataclass(frozen=True)
class Motion:
    """Samples of a motion, what they would be in contact, and the noise on them.

    The motion is above the surface; `sense` is -1 where it was `mirrored` to be so.
    """

    time: Float[np.ndarray, " k"]
    samples: Float[np.ndarray, " k"]
    contact: Float[np.ndarray, " k"]
    rate: Float[np.ndarray, " k"]
    noise: float
    interval: float
    sense: float = 1.0

    def mirrored(self, contact, rate) -> "Motion":
        """The motion as a surface above it sees it, at `contact` and moving at `rate`,
        both `(k,)` in the units of the samples."""
        return dataclasses.replace(
            self, samples=-self.samples, contact=-contact, rate=-rate, sense=-1.0
        )

    @property
    def gap(self) -> Float[np.ndarray, " k"]:
        return self.samples - self.contact

    def fit(self, first: int, last: int, *, at_end: bool) -> LocalFit:
        """A polynomial through one end of a flight."""
        # the samples next to an impact may be from the other side of it
        inner = slice(first + 1, last - 1) if last - first > 6 else slice(first, last)
        count = max(4, round(_FIT_WINDOW / self.interval))
        rows = np.arange(len(self.time))[inner]
        rows = rows[-count:] if at_end else rows[:count]
        origin = float(self.time[min(last, len(self.time) - 1) if at_end else first])
        return fit_local(self.time[rows], self.samples[rows], self.noise, origin)
