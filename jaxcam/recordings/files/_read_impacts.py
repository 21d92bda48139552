"""Read tables of impacts: one row per impact, with the speeds before and after."""

import re
from pathlib import Path

import numpy as np

from .._errors import RecordingError
from .._impact_table import Bodies, ImpactTable
from .._units import unit_of
from ._choose import column_names, Columns, read_columns
from ._source import listed


_SPEED = re.compile(r"(before|after)([12]?)(_stderr)?_(m_s|rad_s)")

# columns in addition to the speeds
_MORE = ("mass1_kg", "mass2_kg", "time_s")


def is_impact_table(file: str | Path, columns: Columns | None = None) -> bool:
    """Return whether a file has the columns of an impact table, not of a recording.

    **Raises:** `RecordingError` if the file cannot be read.
    """
    names = column_names(Path(file), columns)
    kinds = {found[1] for name in names if (found := _SPEED.fullmatch(name))}
    return kinds == {"before", "after"}


def read_impacts(file: str | Path, *, columns: Columns | None = None) -> ImpactTable:
    r"""Read impacts from a file with one impact per row.

    The column names end with the unit (`_m_s`, `_mm_s`, `_rad_s`, ...). The columns are
    `before` and `after`, the speeds of one body along the normal of a fixed surface; or
    `before1`, `after1`, `before2` and `after2`, the velocities of two bodies, with
    `mass1_kg` and `mass2_kg` if known. `before_stderr` and `after_stderr` are standard
    errors, and `time_s` is the time; other columns are ignored.

    Args:
        file: The file.
        columns: Names of the columns, as for `read_case`.

    Returns:
        An [`jaxcam.recordings.ImpactTable`][].

    Raises:
        RecordingError: The file cannot be used; the message gives the row and says
            how to fix it.

    Examples:
        >>> from pathlib import Path
        >>> from jaxcam.recordings import read_impacts
        >>> text = "before_m_s,after_m_s\n-1.0,0.8\n-2.0,1.5\n"
        >>> _ = Path("drops.csv").write_text(text)
        >>> read_impacts("drops.csv").approach.tolist()
        [1.0, 2.0]
    """
    file = Path(file)
    every = column_names(file, columns)
    asked = [name for name in every if _SPEED.fullmatch(name) or name in _MORE]
    chosen = read_columns(file, needed=asked, columns=columns, only=True)
    found, units = {}, {}
    for name, numbers in chosen.columns.items():
        match = _SPEED.fullmatch(name)
        if match is not None:
            word = "".join(part or "" for part in match.groups()[:3])
            found[word], units[word] = numbers, unit_of(name)
    if len(set(units.values())) > 1:
        raise RecordingError(
            f"{file}: the speeds are in {' and '.join(sorted(set(units.values())))}; "
            "give all of them in one unit."
        )
    two = {"before1", "after1", "before2", "after2"} <= set(found)
    if not two and not {"before", "after"} <= set(found):
        raise RecordingError(
            f"{file}: a table of impacts has the columns before_m_s and after_m_s, or "
            f"before1_m_s, after1_m_s, before2_m_s and after2_m_s; the file has "
            f"{listed(every)}."
        )
    bodies = None
    if two:
        bodies = _bodies(file, found, chosen.columns)
        before = bodies.before[:, 0] - bodies.before[:, 1]
        after = bodies.after[:, 0] - bodies.after[:, 1]
    else:
        before, after = found["before"], found["after"]
    approach, separation = _speeds(file, before, after, signed=two)
    errors = [found.get(f"{side}_stderr") for side in ("before", "after")]
    for error in errors:
        if error is not None and not np.all(error > 0):
            row = int(np.flatnonzero(~(error > 0))[0])
            raise RecordingError(
                f"{file}: the standard error in row {row + 1} is {error[row]:g}; give "
                f"a positive one, or omit the column."
            )
    return ImpactTable(
        file.name.partition(".")[0],
        approach,
        separation,
        next(iter(units.values())),
        approach_stderr=errors[0],
        separation_stderr=errors[1],
        bodies=bodies,
        time=chosen.columns.get("time_s"),
        notes=chosen.notes,
    )


def _bodies(file: Path, found: dict, columns: dict) -> Bodies:
    first, second = (columns.get(f"mass{number}_kg") for number in (1, 2))
    mass = None
    if first is not None and second is not None:
        mass = np.stack([first, second], axis=-1)
        bad = np.flatnonzero(~np.all(mass > 0, axis=-1))
        if len(bad):
            raise RecordingError(
                f"{file}: a mass in row {bad[0] + 1} is not positive; correct it."
            )
    elif first is not None or second is not None:
        raise RecordingError(
            f"{file} has the mass of only one body; give both mass1_kg and mass2_kg."
        )
    before, after = (
        np.stack([found[f"{side}1"], found[f"{side}2"]], axis=-1)
        for side in ("before", "after")
    )
    return Bodies(before, after, mass)


def _speeds(file: Path, before, after, signed: bool):
    """Return approach and separation speeds, from relative velocities or from
    magnitudes.

    **Raises:** `RecordingError`, which names a row without an approach or without an
    impact.
    """
    if not signed and np.all(before >= 0) and np.all(after >= 0):
        approach, separation = before, after
    else:
        approach, separation = np.abs(before), -after * np.sign(before)
    for wrong, what in (
        (approach <= 0, "there is no approach before the impact"),
        (separation < 0, "the bodies pass through each other"),
    ):
        rows = np.flatnonzero(wrong)
        if len(rows):
            more = f" (and in {len(rows) - 1} more rows)" if len(rows) > 1 else ""
            raise RecordingError(
                f"{file}: in row {rows[0] + 1}{more} {what}; correct the signs, give "
                "all velocities along the same normal, or remove the row."
            )
    return approach, separation
