"""Read recordings and cases from files."""

import dataclasses
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from .._errors import RecordingError
from .._recording import Case, Recording
from ._check import check_channels, check_drive, find_gaps
from ._choose import Columns, read_columns, TIME
from ._clock import unrounded
from ._mend import mend, Mended
from ._table import SUFFIXES as TEXT


CAM_FOLLOWER = ("cam_angle_rad", "follower_angle_rad")
"""Channels that a recording of a cam-follower rig must contain."""
SUFFIXES = (*TEXT, ".mat", ".parquet", ".xlsx", ".xlsm")
"""Suffixes of the files of a case."""
# other text files, read if a folder contains none of the above
_LAST_RESORT = (".txt", ".dat", ".xls", ".txt.gz", ".dat.gz")


def read_recordings(
    file: str | Path,
    *,
    channels: Sequence[str] = (),
    split: str | None = None,
    gaps: Literal["refuse", "split", "mend"] = "refuse",
    columns: Columns | None = None,
    rate: float | None = None,
) -> tuple[Recording, ...]:
    r"""Read every recording in one file.

    The file is text (plain or gzip-compressed), `.mat`, `.xlsx` or `.parquet`.
    Column names end with the unit. Columns in `_deg`, `_rpm`, `_ms`, `_mm` and similar
    units are converted and renamed (`cam_angle_deg` -> `cam_angle_rad`), as are columns
    with the unit in brackets (`Time (ms)` -> `time_s`). One column is the time.

    Args:
        file: The file; a name such as `..._150.7rpm.csv` gives the nominal speed.
        channels: Required columns (SI names).
        split: Column with the recording number, for a file with several recordings.
        gaps: `"refuse"` raises an error for a recording with missing samples, `"split"`
            cuts it into pieces, and `"mend"` repairs it: it bridges short gaps, splits
            at long gaps and corrects slips of an encoder (see `mend`). The repairs are
            listed in `meta["notes"]`.
        columns: For a file without a header line, the names of the columns in order,
            with `"-"` to skip one. For columns that have other names in the file, a
            mapping from those names to channels, optionally with a factor: `{"Angle":
            "angle_deg", "Y1": ("height_m", -8e-4)}`; then only named or required
            columns are read, and rows with an empty cell in one of these columns are
            omitted.
        rate: Sampling rate of a file without a time column (Hz).

    Returns:
        A tuple of `Recording`, one for each run and piece.

    Raises:
        RecordingError: The file cannot be used; the message says how to fix it.

    Examples:
        >>> from pathlib import Path
        >>> from jaxcam.recordings.files import read_recordings
        >>> rows = "time_s,height_mm\n0.0,10\n0.1,11\n0.2,12\n0.5,20\n0.6,21\n0.7,22\n"
        >>> _ = Path("drops.csv").write_text(rows)
        >>> pieces = read_recordings("drops.csv", gaps="split")
        >>> [piece["height_m"].tolist() for piece in pieces]
        [[0.01, 0.011, 0.012], [0.02, 0.021, 0.022]]
    """
    file = Path(file)
    chosen = read_columns(
        file, needed=(TIME, *channels), columns=columns, rate=rate, split=split
    )
    found = chosen.columns
    stem = _stem(file)
    runs = {stem: np.arange(len(found["time_s"]))}
    if split is not None:
        numbers = found.pop(split)
        runs = {
            f"{stem}_{split}{number:g}": np.flatnonzero(numbers == number)
            for number in np.unique(numbers)
        }
    speed = _nominal_speed(file)
    recordings = []
    for name, rows in runs.items():
        time = unrounded(found["time_s"][rows])
        values = {c: v[rows] for c, v in found.items() if c != "time_s"}
        label = f"{file}: {name}" if split else str(file)
        if gaps == "mend":
            find_gaps(label, time, "split")
            whole = Recording(name, time, values, speed, {"file": str(file)})
            pieces = _turning(label, mend(whole))
        else:
            pieces = _split(
                name, time, values, speed, file, find_gaps(label, time, gaps)
            )
        for recording in pieces:
            check_channels(recording)
            check_drive(recording)
        recordings += [_noted(piece, chosen.notes, chosen.unread) for piece in pieces]
    return tuple(recordings)


def read_recording(
    file: str | Path,
    *,
    channels: Sequence[str] = (),
    columns: Columns | None = None,
    rate: float | None = None,
) -> Recording:
    r"""Read a file that contains a single recording.

    Args:
        file: The file.
        channels: As for `read_case`.
        columns: As for `read_case`.
        rate: As for `read_case`.

    Returns:
        A [`jaxcam.recordings.Recording`][].

    Raises:
        RecordingError: The file cannot be used; the message says how to fix it.

    Examples:
        >>> from pathlib import Path
        >>> from jaxcam.recordings import read_recording
        >>> _ = Path("run.csv").write_text("time_s,angle_deg\n0.0,0\n0.1,90\n0.2,180\n")
        >>> run = read_recording("run.csv")
        >>> run.channels["angle_rad"].round(3).tolist()
        [0.0, 1.571, 3.142]
    """
    (recording,) = read_recordings(file, channels=channels, columns=columns, rate=rate)
    return recording


def read_case(
    folder: str | Path,
    *,
    channels: Sequence[str] = (),
    split: str | None = None,
    gaps: Literal["refuse", "split", "mend"] = "refuse",
    columns: Columns | None = None,
    rate: float | None = None,
) -> Case:
    """Read all recordings in a folder, ordered by name.

    Files are text (CSV of any kind, `.tsv`, `.lvm`; plain or gzip-compressed), `.mat`,
    `.xlsx` or `.parquet`; if there are none of these, `.txt`, `.dat` and `.xls` are
    read.

    Args:
        folder: The folder.
        channels: Required columns (SI names).
        split: Column with the recording number, for a file with several recordings.
        gaps: Handling of a recording with missing samples: `"refuse"` raises an error,
            `"split"` cuts it into pieces, `"mend"` repairs it (see `mend`).
        columns: For files without a header line, the names of the columns in order,
            with `"-"` to skip one. For columns that have other names in the files, a
            mapping from those names to channels, optionally with a factor: `{"Angle":
            "angle_deg", "Y1": ("height_m", -8e-4)}`; then rows with an empty cell in
            one of these columns are omitted.
        rate: Sampling rate of files without a time column (Hz).

    Returns:
        A case.

    Raises:
        RecordingError: A file cannot be used; the message says how to fix it.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.recordings import read_case
        >>> len(read_case(DEMO_RIG).recordings) > 1
        True
    """
    folder = Path(folder)
    if not folder.exists():
        raise RecordingError(f"{folder}: there is no such folder; check the path.")
    if not folder.is_dir():
        raise RecordingError(
            f"{folder}: this is a file, but a case is a folder of recordings; give the "
            "folder that contains it."
        )
    files = _files_of(folder)
    if not files:
        cases = sorted(sub.name for sub in folder.iterdir() if sub.is_dir())
        hint = f"; give one of its folders ({', '.join(cases[:4])})" if cases else ""
        raise RecordingError(
            f"{folder}: there is no recording (*.csv, *.tsv, *.mat, *.xlsx, *.parquet) "
            f"in this folder{hint}."
        )
    recordings = []
    for file in files:
        recordings += read_recordings(
            file,
            channels=channels,
            split=split,
            gaps=gaps,
            columns=columns,
            rate=rate,
        )
    return Case(folder.resolve().name, tuple(recordings), folder)


def _split(name, time, values, speed, file, breaks) -> list[Recording]:
    pieces = np.split(np.arange(len(time)), breaks)
    pieces = [piece for piece in pieces if len(piece) > 1]
    return [
        Recording(
            name=name if len(pieces) == 1 else f"{name}_piece{number}",
            time=time[piece],
            channels={c: v[piece] for c, v in values.items()},
            nominal_speed=speed,
            meta={"file": str(file), "piece": number, "pieces": len(pieces)},
        )
        for number, piece in enumerate(pieces, start=1)
    ]


def _turning(label: str, mended: Mended) -> list[Recording]:
    """Return the pieces in which the cam turns by at least half a turn.

    **Raises:** `RecordingError` if none is left.
    """
    pieces, notes = [], list(mended.notes)
    for piece in mended.recordings:
        cam = piece.channels.get("cam_angle_rad")
        if cam is not None and np.ptp(cam) < np.pi:
            notes.append(
                f"{piece.name} covers less than half a turn of the cam and is omitted."
            )
        else:
            pieces.append(piece)
    if not pieces:
        raise RecordingError(
            f"{label}: the cam turns by less than half a turn; record for longer, "
            f"or check `cam_angle_rad`."
        )
    return [
        dataclasses.replace(p, meta={**p.meta, "notes": tuple(notes)}) for p in pieces
    ]


def _noted(
    piece: Recording, notes: tuple[str, ...], unread: tuple[str, ...]
) -> Recording:
    """Return a piece whose notes begin with the remarks on omitted data of its file,
    with the names of the columns that were not read.
    """
    meta = dict(piece.meta)
    if notes:
        meta["notes"] = (*notes, *meta.get("notes", ()))
    if unread:
        meta["unread"] = unread
    return dataclasses.replace(piece, meta=meta)


def has_recordings(folder: Path) -> bool:
    """Return whether a folder contains files that may be recordings."""
    return folder.is_dir() and bool(_files_of(folder))


def _files_of(folder: Path) -> list[Path]:
    return _tables(folder, SUFFIXES) or _tables(folder, _LAST_RESORT)


def _tables(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """Return files with these suffixes, in the order of their names."""
    every = (file for file in folder.iterdir() if file.is_file())
    return sorted(file for file in every if file.name.lower().endswith(suffixes))


def _stem(file: Path) -> str:
    ending = "|".join(re.escape(end) for end in (*SUFFIXES, *_LAST_RESORT))
    return re.sub(f"({ending})$", "", file.name, flags=re.IGNORECASE)


def _nominal_speed(file: Path) -> float | None:
    number = r"(?<![\d.])(\d{1,6}(?:\.\d{1,9})?)\s*rpm"
    found = re.search(number, file.name, re.ASCII)
    return float(found[1]) * 2 * math.pi / 60 if found else None
