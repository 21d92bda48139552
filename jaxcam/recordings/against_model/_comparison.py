"""The result of a comparison with a model, for each mode."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from rich.table import Table

from ...tables import scaled
from .._units import without_unit


@dataclasses.dataclass(frozen=True)
class Residuals:
    """Recording minus model in one mode of one recording."""

    record: str
    """Name of the recording."""
    mode: str
    """`"flight"`, `"contact"`, `"impact position"` or `"impact speed"`."""
    channel: str
    """The channel."""
    unit: str
    """Unit of the differences, empty if the channel's name states none."""
    time: Float[np.ndarray, " k"]
    """Time in the recording (s)."""
    turned: Float[np.ndarray, " k"]
    """Angle of the cam (rad), or empty."""
    value: Float[np.ndarray, " k"]
    """The differences, in `unit`."""
    stderr: Float[np.ndarray, " k"]
    """Standard errors from the noise alone."""
    piece: Int[np.ndarray, " k"]
    """Index of the flight, contact or impact of each value."""
    fitted: int = 0
    """Number of parameters that were fitted to the values."""


@dataclasses.dataclass(frozen=True)
class Row:
    """Summary of one mode and channel of a comparison."""

    mode: str
    """The mode."""
    channel: str
    """The channel."""
    unit: str
    """Unit of the residuals."""
    count: int
    """Number of flights, contacts or impacts."""
    samples: int
    """Number of values compared."""
    rms: float
    """Root mean square of the residuals, in `unit`."""
    noise: float
    """Standard deviation of the noise, in `unit`."""
    ratio: float
    """Residual in units of the noise; 1 if the model explains everything that the
    sensors resolve.
    """
    worst_record: str
    """Recording with the most significant mean difference over 10 ms."""
    worst_time: float
    """Midpoint of the 10 ms with the most significant mean difference (s)."""
    worst_phase: float
    """Cam angle within one turn at `worst_time` (rad)."""
    worst_score: float
    """Magnitude of the mean difference over the 10 ms around `worst_time`, in standard
    errors.
    """

    def shown(self) -> tuple[str, str, str]:
        """Return the residual and the noise as text, and the unit of both: that of the
        figures.
        """
        factor, unit = scaled(self.unit, 4 * max(self.rms, self.noise))
        return f"{factor * self.rms:.2g}", f"{factor * self.noise:.2g}", unit


@dataclasses.dataclass(frozen=True)
class Comparison:
    """A comparison of recordings with a model, flight by flight.

    All results are computed from `residuals`.
    """

    residuals: tuple[Residuals, ...]
    """One entry for each recording, mode and channel."""
    notes: tuple[str, ...] = ()
    """Remarks, one sentence each."""

    @property
    def rows(self) -> tuple[Row, ...]:
        """One `Row` for each mode and channel, over all recordings."""
        groups: dict[tuple[str, str], list[Residuals]] = {}
        for part in self.residuals:
            groups.setdefault((part.mode, part.channel), []).append(part)
        modes = list(_PLACES)
        ordered = sorted(groups.items(), key=lambda item: modes.index(item[0][0]))
        return tuple(_row(parts) for _, parts in ordered)

    def row(self, mode: str, channel: str | None = None) -> Row:
        """Return the row of a mode.

        Raises:
            KeyError: There is no such mode; the message names the modes.
        """
        for row in self.rows:
            if row.mode == mode and channel in (None, row.channel):
                return row
        there = ", ".join(f"{row.mode} of {row.channel}" for row in self.rows)
        raise KeyError(f"there is no {mode!r} in this comparison; there is {there}")

    def table(self) -> Table:
        """Return the residuals of each mode as a table for the terminal."""
        table = Table(title="Recording minus model for each mode")
        several = len({row.channel for row in self.rows}) > 1
        for heading in ("mode", "unit"):
            table.add_column(heading, no_wrap=True)
        for heading in ("pieces", "rms", "noise", "ratio"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("most significant at")
        for row in self.rows:
            rms, noise, unit = row.shown()
            table.add_row(
                f"{row.mode} of {without_unit(row.channel)}" if several else row.mode,
                unit,
                str(row.count),
                rms,
                noise,
                f"{row.ratio:.2f}",
                _place(row).replace(" at ", "\n", 1),
            )
        return table

    def sentence(self) -> str:
        """Return a summary in words."""
        words = [_words(row) for row in self.rows]
        if not words:
            return "Nothing could be compared: " + " ".join(self.notes)
        return " ".join([". ".join(words) + ".", *self.notes])

    def to_json(self) -> dict[str, Any]:
        """Return the comparison as plain data; missing numbers are `None`."""
        rows = [_plain(dataclasses.asdict(row)) for row in self.rows]
        return {"rows": rows, "sentence": self.sentence(), "notes": list(self.notes)}


def merge(comparisons: Sequence[Comparison]) -> Comparison:
    """Merge the comparisons of several recordings.

    Args:
        comparisons: The comparisons.

    Returns:
        One comparison.

    Examples:
        >>> from jaxcam.recordings import merge
        >>> from jaxcam.recordings.against_model import Comparison
        >>> merge([Comparison(()), Comparison(())]).rows
        ()
    """
    residuals = [part for one in comparisons for part in one.residuals]
    notes = [note for one in comparisons for note in one.notes]
    return Comparison(tuple(residuals), tuple(notes))


def _row(parts: list[Residuals]) -> Row:
    value = np.concatenate([part.value for part in parts])
    stderr = np.concatenate([part.stderr for part in parts])
    free = max(1, len(value) - sum(part.fitted for part in parts))
    record, time, turned, score = _worst(parts)
    return Row(
        mode=parts[0].mode,
        channel=parts[0].channel,
        unit=parts[0].unit,
        count=sum(len(np.unique(part.piece)) for part in parts),
        samples=len(value),
        rms=float(np.sqrt(np.sum(value**2) / free)),
        noise=float(np.sqrt(np.mean(stderr**2))),
        ratio=float(np.sqrt(np.sum((value / stderr) ** 2) / free)),
        worst_record=record,
        worst_time=time,
        worst_phase=turned % (2 * math.pi),
        worst_score=score,
    )


def _worst(parts: list[Residuals]) -> tuple[str, float, float, float]:
    """Return the recording, time, cam angle and significance of the 10 ms interval with
    the most significant mean.
    """
    best = ("", float("nan"), float("nan"), 0.0)
    for part in parts:
        scaled = part.value / part.stderr
        for piece in np.unique(part.piece):
            rows = np.flatnonzero(part.piece == piece)
            steps = np.diff(part.time[rows])
            width = round(0.01 / np.median(steps)) if len(steps) else 1
            width = int(np.clip(width, 1, len(rows)))
            window = np.ones(width) / math.sqrt(width)
            score = np.abs(np.convolve(scaled[rows], window, mode="valid"))
            place = int(np.argmax(score))
            if score[place] > best[3]:
                at = rows[place + width // 2]
                moment = float(part.time[at])
                turned = float(part.turned[at])
                best = (part.record, moment, turned, float(score[place]))
    return best


_PLACES = {
    "flight": "In flight, {channel} differs from the model by {ratio} times the noise",
    "contact": "In contact, it differs from the surface by {ratio} times the noise",
    "impact position": "At impacts, the position differs from the surface by {ratio} "
    "times its standard error",
    "impact speed": "The speeds after impacts differ from the impact law by {ratio} "
    "times their standard error",
}


def _words(row: Row) -> str:
    channel = f"the {without_unit(row.channel)}"
    start = _PLACES[row.mode].format(channel=channel, ratio=f"{row.ratio:.1f}")
    rms, _, unit = row.shown()
    size = f" ({rms} {unit}".rstrip() + f" rms over {row.count} {_plural(row)})"
    # pure noise also has a most significant place, which is not reported
    where = f", most clearly in {_place(row)}" if row.ratio > 1.15 else ""
    return start + size + where


def _plural(row: Row) -> str:
    noun = row.mode.split()[0]
    return noun if row.count == 1 else f"{noun}s"


def _place(row: Row) -> str:
    phase = "" if math.isnan(row.worst_phase) else f", cam at {row.worst_phase:.2f} rad"
    return f"{row.worst_record} at {row.worst_time:.3f} s{phase}"


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    def plain(value):
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return {name: plain(value) for name, value in row.items()}
