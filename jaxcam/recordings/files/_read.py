"""Recordings and cases from files."""

import dataclasses
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from .._errors import RecordingError
from .._recording import Case, Recording
from ._binary_table import read_mat, read_parquet
from ._check import check_channels, check_drive, find_gaps
from ._clock import unrounded
from ._mend import mend, Mended
from ._table import read_table, shown, SUFFIXES as TEXT
from ._units import si


#: what a recording of a cam-follower rig must contain
CAM_FOLLOWER = ("cam_angle_rad", "follower_angle_rad")
SUFFIXES = (*TEXT, ".mat", ".parquet")


def read_recordings(
    file: str | Path,
    *,
    channels: Sequence[str] = (),
    split: str | None = None,
    gaps: Literal["refuse", "split", "mend"] = "refuse",
) -> tuple[Recording, ...]:
    """Every recording in one file: CSV (plain or gz), MATLAB .mat or Parquet.

    The end of a column's name is its unit; `_deg`, `_rpm`, `_ms`, `_mm` and the like
    are converted and the column is renamed (`cam_angle_deg` -> `cam_angle_rad`). One
    column is the time.

    **Arguments:**

    - `file`: the file. `..._150.7rpm.csv` in its name is the nominal speed.
    - `channels`: columns that must be there (SI names).
    - `split`: a column that numbers the runs in a file that holds several.
    - `gaps`: `"refuse"` a record with samples missing, `"split"` it in pieces, or
        `"mend"` it: bridge short gaps, split at long ones and undo slips of an encoder
        (see `mend`); what was done is in `meta["notes"]`.

    **Returns:** a tuple of `Recording`, one for each run and piece.

    **Raises:** `RecordingError`, one sentence that says what to do.
    """
    file = Path(file)
    columns = {}
    for name, numbers in _columns(file).items():
        renamed, factor = (name, 1.0) if name == split else si(name)
        if renamed in columns:
            raise RecordingError(
                f"{file}: two columns give `{renamed}` once their units are converted; "
                f"remove one of them."
            )
        columns[renamed] = numbers * factor
    _require(file, columns, ("time_s", *channels, *([split] if split else [])))

    stem = _stem(file)
    runs = {stem: np.arange(len(columns["time_s"]))}
    if split is not None:
        numbers = columns.pop(split)
        runs = {
            f"{stem}_{split}{number:g}": np.flatnonzero(numbers == number)
            for number in np.unique(numbers)
        }
    speed = _nominal_speed(file)
    recordings = []
    for name, rows in runs.items():
        time = unrounded(columns["time_s"][rows])
        values = {c: v[rows] for c, v in columns.items() if c != "time_s"}
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
        recordings += pieces
    return tuple(recordings)


def read_recording(
    file: str | Path, *, channels: Sequence[str] = CAM_FOLLOWER
) -> Recording:
    """The one recording in a file; see `read_recordings` for files with several.

    **Raises:** `RecordingError`, one sentence that says what to do.
    """
    (recording,) = read_recordings(file, channels=channels)
    return recording


def read_case(
    folder: str | Path,
    *,
    channels: Sequence[str] = CAM_FOLLOWER,
    split: str | None = None,
    gaps: Literal["refuse", "split", "mend"] = "refuse",
) -> Case:
    """All recordings in a folder, in the order of their names.

    **Arguments:** as for `read_recordings`; `channels=()` for something other than a
    cam-follower rig.

    **Raises:** `RecordingError`, one sentence that says what to do.
    """
    folder = Path(folder)
    if not folder.exists():
        raise RecordingError(f"{folder}: there is no such folder; check the path.")
    if not folder.is_dir():
        raise RecordingError(
            f"{folder}: a case is a folder of recordings, and this is a file; name the "
            f"folder that holds it."
        )
    files = sorted(
        file for file in folder.iterdir() if file.is_file() and _is_table(file)
    )
    if not files:
        cases = sorted(sub.name for sub in folder.iterdir() if sub.is_dir())
        hint = f"; name one of its folders ({', '.join(cases[:4])})" if cases else ""
        raise RecordingError(
            f"{folder}: there is no recording (*.csv, *.csv.gz, *.mat, *.parquet) in "
            f"this folder{hint}."
        )
    recordings = []
    for file in files:
        recordings += read_recordings(file, channels=channels, split=split, gaps=gaps)
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
    """The pieces, less those in which a cam turns too little to be followed.

    **Raises:** `RecordingError` where none is left.
    """
    pieces, notes = [], list(mended.notes)
    for piece in mended.recordings:
        cam = piece.channels.get("cam_angle_rad")
        if cam is not None and np.ptp(cam) < np.pi:
            notes.append(f"{piece.name}: it has less than half a turn; it is left out.")
        else:
            pieces.append(piece)
    if not pieces:
        raise RecordingError(
            f"{label}: the cam turns by less than half a turn; record the run for "
            f"longer, or check `cam_angle_rad`."
        )
    return [
        dataclasses.replace(p, meta={**p.meta, "notes": tuple(notes)}) for p in pieces
    ]


def _columns(file: Path):
    """Columns of a file by their names, read according to its ending."""
    if file.name.lower().endswith(".mat"):
        return read_mat(file)
    if file.name.lower().endswith(".parquet"):
        return read_parquet(file)
    return read_table(file)


def _require(file, columns, needed) -> None:
    missing = [name for name in needed if name not in columns]
    if missing:
        there = ", ".join(map(shown, list(columns)[:12]))
        there += f" and {len(columns) - 12} more" if len(columns) > 12 else ""
        raise RecordingError(
            f"{file}: the column `{missing[0]}` is missing; the file has {there}."
        )


def _is_table(file: Path) -> bool:
    return file.name.lower().endswith(SUFFIXES)


def _stem(file: Path) -> str:
    ending = r"\.((csv|tsv)(\.gz)?|mat|parquet)$"
    return re.sub(ending, "", file.name, flags=re.IGNORECASE)


def _nominal_speed(file: Path) -> float | None:
    number = r"(?<![\d.])(\d{1,6}(?:\.\d{1,9})?)\s*rpm"
    found = re.search(number, file.name, re.ASCII)
    return float(found[1]) * 2 * math.pi / 60 if found else None
