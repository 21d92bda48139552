"""Select the columns of a file that are channels of a recording, in SI units."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from .._errors import RecordingError
from .._units import si
from ._excel import read_excel
from ._mat import read_mat
from ._parquet import read_parquet
from ._source import listed, shown, Source
from ._table import LEFT_OUT, read_table


Columns: TypeAlias = Sequence[str] | Mapping[str, str | tuple[str, float]]
"""Names of the columns in order, with `"-"` to skip one; or a mapping from column names
in the file to channels, each with an optional factor: `{"Y1": ("height_mm", -0.8)}`.
"""
TIME = "time_s"


@dataclasses.dataclass(frozen=True)
class Chosen:
    """Channels by name, including the time, remarks on omitted data, and the names of
    the columns that were not read.
    """

    columns: dict[str, Float[np.ndarray, " k"]]
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()


def read_columns(
    file: Path,
    *,
    needed: Sequence[str],
    columns: Columns | None,
    rate: float | None = None,
    split: str | None = None,
    only: bool = False,
) -> Chosen:
    """Return the channels of a file in SI units, for `read_recordings`.

    **Arguments:** `needed` are the required channels (SI names); with `only`, no others
    are read.

    **Raises:** `RecordingError`, which says how to fix it.
    """
    source, mapping = _opened(file, columns)
    picks = [(name, *mapping.get(name, (name, 1.0))) for name in source.columns]
    if mapping or only:
        # omit all other columns, except those that are needed
        wanted = set(needed)
        picks = [
            pick
            for pick in picks
            if pick[0] in mapping or pick[0] == split or si(pick[0])[0] in wanted
        ]
    found: dict[str, np.ndarray] = {}
    for name, channel, factor in picks:
        renamed, unit = (name, 1.0) if name == split else si(channel)
        if renamed in found:
            raise RecordingError(
                f"{file}: two columns give `{renamed}` once their units are converted; "
                f"remove one of them."
            )
        numbers = source.numbers(name, missing=columns is not None)
        found[renamed] = numbers * (factor * unit)
    found = _timed(source, found, rate)
    _require(source, found, (*needed, *([split] if split else [])))
    picked = {name for name, _, _ in picks}
    unread = tuple(name for name in source.columns if name not in picked)
    return dataclasses.replace(_without_missing(source, found), unread=unread)


def column_names(file: Path, columns: Columns | None) -> tuple[str, ...]:
    """Return the names of the channels of a file, in SI units.

    **Raises:** `RecordingError` for a file that cannot be read.
    """
    source, mapping = _opened(file, columns)
    return tuple(si(mapping.get(name, (name, 1.0))[0])[0] for name in source.columns)


def _opened(
    file: Path, columns: Columns | None
) -> tuple[Source, dict[str, tuple[str, float]]]:
    """Return the content of a file, and the channel and factor of each column that is
    renamed.
    """
    if columns is None:
        return _source(file, None), {}
    if isinstance(columns, Mapping):
        source = _source(file, None)
        return source, _mapping(file, source, columns)
    return _source(file, _in_order(file, columns)), {}


def _require(source: Source, found: Mapping[str, object], needed: Sequence[str]):
    """Raise `RecordingError` for a missing channel, with the headings of the file."""
    missing = [name for name in needed if name not in found]
    if missing:
        raise RecordingError(
            f"{source.file}: the column `{missing[0]}` is missing; the file has "
            f"{listed(source.columns)}; assign it with --columns or in [columns] of "
            f"the rig file (columns=... in Python)."
        )


def _source(file: Path, names: Sequence[str] | None) -> Source:
    """Return the content of a file, read according to its suffix."""
    name = file.name.lower()
    if name.endswith((".mat", ".parquet")):
        if names is not None:
            raise RecordingError(
                f"{file}: its columns already have names; give pairs, such as "
                "--columns angle=angle_rad (columns={...} in Python)."
            )
        return read_mat(file) if name.endswith(".mat") else read_parquet(file)
    if name.endswith((".xlsx", ".xlsm")):
        return read_excel(file, names)
    return read_table(file, names)


def _in_order(file: Path, names) -> list[str]:
    kept = [name for name in names if name != LEFT_OUT]
    bad = [name for name in kept if not isinstance(name, str) or not name.strip()]
    twice = [name for name in kept if kept.count(name) > 1]
    if bad or twice or not kept:
        what = f"{twice[0]!r} twice" if twice else "a column without a name"
        raise RecordingError(
            f"{file}: --columns names {what}; give each column one name, or "
            f"{LEFT_OUT} to skip it."
        )
    return list(names)


def _mapping(
    file: Path, source: Source, columns: Mapping
) -> dict[str, tuple[str, float]]:
    """Return the channel and the factor of each named column."""
    found: dict[str, tuple[str, float]] = {}
    for word, channel in columns.items():
        name, factor = channel if isinstance(channel, tuple) else (channel, 1.0)
        if not math.isfinite(factor) or factor == 0:
            raise RecordingError(
                f"{file}: the factor of {shown(str(word))} is {factor:g}; give the "
                f"number that converts it to the unit of `{name}`."
            )
        found[source.name_of(str(word))] = (name, float(factor))
    return found


def _timed(source: Source, found: dict, rate: float | None) -> dict:
    """Return the columns; if there is no time column, add one that follows from the
    rate.
    """
    if rate is not None and not (math.isfinite(rate) and rate > 0):
        raise RecordingError(
            f"{source.file}: the rate is {rate:g} samples per second; give a positive "
            f"number."
        )
    if rate is not None and TIME in found:
        raise RecordingError(
            f"{source.file} already has the time column `{TIME}`; omit the rate or "
            "that column."
        )
    rate = source.rate if rate is None else rate
    if TIME in found or rate is None or not rate > 0 or not found:
        return found
    count = len(next(iter(found.values())))
    return {TIME: np.arange(count) / rate, **found}


def _without_missing(source: Source, found: dict) -> Chosen:
    """Return the rows in which every channel has a number."""
    whole = np.all([np.isfinite(numbers) for numbers in found.values()], axis=0)
    lost = int(np.sum(~whole))
    if not lost:
        return Chosen(found, source.notes)
    if np.sum(whole) < 2:
        raise RecordingError(
            f"{source.file}: fewer than two rows have a number in each of "
            f"{listed(found)}; name other columns."
        )
    first = np.flatnonzero(~whole)[0] + 1
    place = f"row {first} (counted without the heading)"
    what = "no number in one of the columns and"
    note = (
        f"{source.file.name}: {place} has {what} is omitted."
        if lost == 1
        else f"{source.file.name}: {lost} rows, the first of them {place}, have {what} "
        "are omitted."
    )
    return Chosen(
        {name: numbers[whole] for name, numbers in found.items()}, (*source.notes, note)
    )
