"""Residuals of a fit: data minus model, with recording, mode, time and phase."""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float, Int

from ._fit_result import Fit
from .engine import predict


@dataclasses.dataclass(frozen=True)
class Residuals:
    """Data minus model for one channel of one recording, in the unit of the channel.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Examples:
        >>> from jaxcam.fitting import residuals
        >>> residuals(found)[0].rms < 2e-3
        True
    """

    record: str
    """Name of the recording."""
    channel: str
    """The channel."""
    time: Float[np.ndarray, " k"]
    """Times (s), shape `(k,)`."""
    turned: Float[np.ndarray, " k"]
    """Angle of the drive (rad), shape `(k,)`, or empty."""
    value: Float[np.ndarray, " k"]
    """Residuals, shape `(k,)`."""
    flight: Int[np.ndarray, " k"]
    """Index of the flight or contact of each sample, shape `(k,)`."""
    resting: Bool[np.ndarray, " k"]
    """Whether each sample is in contact, shape `(k,)`."""
    noise: float
    """Standard deviation of noise and rounding."""

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.value**2)))

    def autocorrelation(self, lags: int = 20) -> Float[np.ndarray, " lags"]:
        """Return the correlation of samples at lags 1, 2, ... within a flight or
        contact.

        For k samples with white residuals, the correlations are within about
        `2 / sqrt(k)` of zero.
        """
        scale = np.mean(self.value**2)
        found = []
        for lag in range(1, lags + 1):
            same = (self.flight[lag:] == self.flight[:-lag]) & (
                self.resting[lag:] == self.resting[:-lag]
            )
            found.append(np.mean((self.value[lag:] * self.value[:-lag])[same]) / scale)
        return np.array(found)


def residuals(found: Fit) -> list[Residuals]:
    """Return the residuals of each recording and channel, sorted by time.

    Saturated samples are left out. The example continues the one in
    [`jaxcam.fitting.fit`][].

    Args:
        found: The fit.

    Returns:
        A list of [`jaxcam.fitting.Residuals`][].

    Examples:
        >>> from jaxcam.fitting import residuals
        >>> residuals(found)[0].channel
        'height_m'
    """
    problem = found.problem
    pieces = problem.pieces
    flown, rested, _ = predict(problem.layout, pieces, problem.extras, found.point)
    parts = []
    for record, segments in enumerate(problem.segments):
        for c, (channel, sensor) in enumerate(problem.model.sensors.items()):
            columns = []
            for side, (part, seen) in enumerate(
                ((pieces.flown, flown), (pieces.rested, rested))
            ):
                known = np.asarray(part.known[record, ..., c])
                value = np.asarray(part.value[record, ..., c])
                known = known & (np.abs(value) < sensor.limit)
                k, n, _ = np.nonzero(known)
                along = n + np.asarray(part.place[record])[known]
                start, step = (
                    np.asarray(x[record])[k] for x in (part.start, part.step)
                )
                time = start + step * along
                flights = np.array([s.flight for s in problem.spans[record][side]])
                columns.append(
                    (
                        time,
                        (value - np.asarray(seen[record, ..., c]))[known],
                        flights[k] if len(flights) else k,
                        np.full(len(k), bool(side)),
                    )
                )
            time, value, flight, resting = (np.concatenate(x) for x in zip(*columns))
            order = np.argsort(time)
            turned = np.full(len(time), np.nan)
            if segments.drive is not None:
                turned = np.interp(time, segments.recording.time, segments.drive.angle)
            parts.append(
                Residuals(
                    segments.recording.name,
                    channel,
                    time[order],
                    turned[order],
                    value[order],
                    flight[order],
                    resting[order],
                    float(sensor.floor),
                )
            )
    return parts
