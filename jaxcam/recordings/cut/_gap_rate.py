"""The measured rate of change of a gap, as a gyroscope or a tachometer shows it.

An impact is a jump of this rate, which is far easier to see than a bend of the gap; and
a body near a surface is in contact only if the rate is zero.
"""

import dataclasses
import functools

import numpy as np
from jaxtyping import Bool, Float, Int

from ._kinks import find_kinks, WINDOW
from ._polynomial import fit_local, LocalFit, measured_noise


# Standard errors by which a mean rate or a slope of the rate must differ from zero
_SURE = 5.0
# Largest rms residual, in units of the noise, of a straight line that describes a rate
_DESCRIBED = 1.5
# Duration (s) of the stretches whose changes of the gap give the offset of the sensor
_OFFSET_WINDOW = 0.1


@dataclasses.dataclass(frozen=True)
class GapRate:
    """Samples of the rate of change of a gap, and their noise."""

    time: Float[np.ndarray, " k"]
    values: Float[np.ndarray, " k"]
    noise: float
    interval: float

    @classmethod
    def of(
        cls,
        time: Float[np.ndarray, " k"],
        values: Float[np.ndarray, " k"],
        gap: Float[np.ndarray, " k"],
        interval: float,
    ) -> "GapRate":
        """Return the rate without the offset of its sensor, which the `gap` shows.

        The rate times the duration of a stretch must be the change of the gap. The
        median over all stretches is not affected by those that contain an impact.
        """
        steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
        excess = np.concatenate([[0.0], np.cumsum(steps)]) - (gap - gap[0])
        apart = min(max(1, round(_OFFSET_WINDOW / interval)), len(time) - 1)
        offset = np.median((excess[apart:] - excess[:-apart]) / (apart * interval))
        return cls(time, values - offset, measured_noise(values), interval)

    @functools.cached_property
    def jumps(self) -> Int[np.ndarray, " jumps"]:
        """Index of the first sample after each upward jump, as an impact causes it."""
        return find_kinks(self.values, self.interval, self.noise, derivative=0)

    @functools.cached_property
    def moving(self) -> Bool[np.ndarray, " k"]:
        """Whether the mean rate about each sample certainly differs from zero.

        No mean extends across a jump.
        """
        count, place = len(self.values), np.arange(len(self.values))
        edges = np.concatenate([[0], self.jumps, [count]])
        part = np.searchsorted(edges, place, side="right")
        first, last = edges[part - 1], edges[part]
        begin = np.maximum(first, place - self._window // 2)
        end = np.minimum(last, begin + self._window)
        begin = np.maximum(first, end - self._window)
        sums = np.concatenate([[0.0], np.cumsum(self.values)])
        number = end - begin
        mean = (sums[end] - sums[begin]) / number
        return np.abs(mean) > _SURE * self.noise / np.sqrt(number)

    def turns(self, first: int, last: int) -> bool:
        """Return whether the motion turns round in a stretch of samples instead of
        coming to rest: the rate changes steadily there.
        """
        edges = np.concatenate([[0], self.jumps, [len(self.values)]])
        # a rate that is zero in the stretch and changes next to it is not a line
        reach = 2 * self._window
        begin = max(first - reach, int(np.max(edges[edges <= first])))
        end = min(last + reach, int(np.min(edges[edges >= last])))
        time = self.time[begin:end] - np.mean(self.time[begin:end])
        if len(time) < 3:
            return False
        slope, level = np.polyfit(time, self.values[begin:end], 1)
        rest = self.values[begin:end] - level - slope * time
        described = np.sum(rest**2) <= (_DESCRIBED * self.noise) ** 2 * (len(time) - 2)
        return bool(
            described and abs(slope) * np.linalg.norm(time) > _SURE * self.noise
        )

    def before(self, first: int, place: int) -> LocalFit:
        """Return the rate before the jump at a `place`, in a flight that begins at
        `first`.
        """
        rows = slice(max(first, place - self._window), place)
        return self._line(rows, float(self.time[place]))

    def after(self, place: int, last: int) -> LocalFit:
        """Return the rate after the jump at a `place`, in a flight that ends at
        `last`.
        """
        rows = slice(place, min(last, place + self._window))
        return self._line(rows, float(self.time[place]))

    def _line(self, rows: slice, origin: float) -> LocalFit:
        return fit_local(
            self.time[rows], self.values[rows], self.noise, origin, degree=1
        )

    @property
    def _window(self) -> int:
        return max(6, round(WINDOW / self.interval))
