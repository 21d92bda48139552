"""The recordings of a case and the rig they are of, as commands name them."""

from pathlib import Path


def read(case: Path, rig: Path | None, gaps: str):
    """The runs of a folder, and the rig as its maker states it.

    **Raises:** `ValueError` that names the file at fault and the fix.
    """
    from ..recordings import read_case, read_rig

    runs = read_case(case, gaps=gaps)  # pyright: ignore
    return runs, read_rig(_rig_file(case, rig))


def notes_of(runs) -> tuple[str, ...]:
    """What was mended as the runs were read, each note once."""
    return tuple(dict.fromkeys(n for run in runs for n in run.meta.get("notes", ())))


def _rig_file(folder: Path, rig: Path | None) -> Path:
    if rig is not None:
        return rig
    file = folder / "rig.toml"
    if not file.is_file():
        raise ValueError(f"{folder}: there is no rig.toml in it; name one with --rig.")
    return file
