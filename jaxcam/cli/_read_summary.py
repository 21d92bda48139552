"""Summarise what was read from files, before a long computation with it begins."""

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from ..fitting import cam_follower_model, Setup
from ..recordings import Recording, Rig
from ..recordings.files import unit_of
from ..tables import counted
from ._output import Output


# maximum number of files that are all named
_FEW = 3


def print_summary(
    output: Output,
    runs: Sequence[Recording],
    nominal: Rig | Setup,
    notes: Sequence[str] = (),
) -> None:
    """Print what was read, and notes on it."""
    for sentence in (*read_summary(runs, channels_of(nominal)), *notes):
        output.print(sentence)


def channels_of(nominal: Rig | Setup) -> tuple[str, ...]:
    """Return the channels that the model of a rig describes, and that of its drive."""
    if isinstance(nominal, Setup):
        return nominal.channels
    return (*cam_follower_model(nominal).sensors, "cam_angle_rad")


def read_summary(runs: Sequence[Recording], used: Collection[str]) -> tuple[str, str]:
    """Return sentences that say what was read: files, samples, rate, time and ranges of
    the channels, and the columns that are not used.

    **Arguments:** `used`: the channels that the model describes.
    """
    files = list(
        dict.fromkeys(Path(str(r.meta.get("file", r.name))).name for r in runs)
    )
    named = ", ".join(files if len(files) <= _FEW else [files[0], "...", files[-1]])
    number = "" if len(files) <= _FEW else f"{len(files)} files: "
    rates = [1 / run.interval for run in runs]
    lengths = [run.duration for run in runs]
    each = "" if len(runs) == 1 else " each"
    begins = _second(min(run.time[0] for run in runs))
    first = (
        f"Read {counted(len(runs), 'recording')} ({number}{named}): "
        f"{sum(map(len, runs))} samples at {_between(rates)} Hz, "
        f"{_between(lengths)} s{each}, from {begins} s to "
        f"{max(r.time[-1] for r in runs):.4f} s."
    )
    ranges = [_range(runs, name) for name in used]
    unused = list(dict.fromkeys(n for r in runs for n in _unused(r, used)))
    rest = f" Columns not used: {', '.join(unused)}." if unused else ""
    return first, f"Channels: {'; '.join(filter(None, ranges))}.{rest}"


def _range(runs: Sequence[Recording], name: str) -> str:
    every = [run.channels[name] for run in runs if name in run.channels]
    if not every:
        return ""
    low, high = (f(list(map(f, every))) for f in (np.min, np.max))
    unit = unit_of(name)
    return f"{name} from {low:.4g} to {high:.4g} {unit}".rstrip()


def _unused(run: Recording, used: Collection[str]) -> list[str]:
    rest = [name for name in run.channels if name not in used]
    return [*rest, *run.meta.get("unread", ())]


def _between(values: Sequence[float]) -> str:
    """Return one number, or the smallest and the largest if they differ visibly."""
    low, high = f"{min(values):.4g}", f"{max(values):.4g}"
    return low if low == high else f"{low} to {high}"


def _second(time: float) -> str:
    """Return a time (s) with four decimals, and zero without a sign."""
    return f"{round(float(time), 4) + 0.0:.4f}"
