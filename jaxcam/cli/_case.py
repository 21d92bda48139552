"""Read the recordings of a case and the description of their rig."""

from pathlib import Path

from ._corner_warning import warn_of_corners
from ._files_options import Files


SIMULATED = "These recordings, shipped with the package, are simulated."


def read(case: Path, rig: Path | None, files: Files, system: str | None = None):
    """Read the recordings in a folder or in a single file, and their rig file.

    **Arguments:** `system`: `FILE.py:CLASS`, which replaces the system of the rig file.

    Returns:
        A `Case`, and a `Rig` or a `Setup`.

    Raises:
        ValueError: A file is invalid; the message names it and says how to fix it.
    """
    from ..fitting import is_setup, read_setup
    from ..recordings import read_rig
    from ..recordings.files import (
        CAM_FOLLOWER,
        has_recordings,
        read_layout,
        read_tables,
    )

    folder = case.parent if case.is_file() else case
    if case.is_file() or has_recordings(case):
        # without its rig file, a recording of any rig would seem to be one of a
        # cam-follower that lacks channels
        _rig_file(folder, rig)
    usual = folder / "rig.toml" if rig is None else rig
    if system is not None or (usual.is_file() and is_setup(usual)):
        setup = read_setup(_rig_file(folder, rig), system)
        warn_of_corners(setup.model.system)
        runs = _runs(case, setup.channels, files, setup.files)
        return setup.known_of(runs, picked=case.is_file()), setup
    layout = read_layout(usual, read_tables(usual) if usual.is_file() else {})
    runs = _runs(case, CAM_FOLLOWER, files, layout)
    return runs, read_rig(_rig_file(folder, rig))


def _runs(case: Path, channels, files: Files, layout):
    """Read the recordings; options on the command line take precedence over the rig
    file.
    """
    from ..recordings import read_case
    from ..recordings.files import Case, read_recordings

    named = files.named()
    options = {
        "channels": channels,
        "split": files.split,
        "gaps": files.how,
        "columns": layout.columns if named is None else named,
        "rate": layout.rate if files.rate is None else files.rate,
    }
    if case.is_file():
        return Case(case.name.partition(".")[0], read_recordings(case, **options))
    return read_case(case, **options)


def notes_of(runs, case: Path) -> tuple[str, ...]:
    """Return notes on the origin of the recordings and on the repairs made while
    reading them, each note once.
    """
    notes = [note for run in runs for note in run.meta.get("notes", ())]
    return tuple(dict.fromkeys([*origin_of(case), *notes]))


def origin_of(case: Path) -> tuple[str, ...]:
    """Return a sentence if the recordings are the simulated ones of the package."""
    from ..data import DEMO_RIG

    if DEMO_RIG not in (case, case.parent):
        return ()
    return (SIMULATED,)


def _rig_file(folder: Path, rig: Path | None) -> Path:
    """Return the rig file.

    **Raises:** `ValueError` if it does not exist.
    """
    if rig is not None:
        if not rig.is_file():
            raise ValueError(f"{rig} does not exist; give the path of a rig file.")
        return rig
    file = folder / "rig.toml"
    if not file.is_file():
        raise ValueError(
            f"{folder} contains no rig.toml; give the rig file with --rig "
            "(`jaxcam new-rig` writes an example)."
        )
    return file
