"""The recordings of a case and the rig they are of, as commands name them."""

from pathlib import Path


def read(case: Path, rig: Path | None, gaps: str, system: str | None = None):
    """The runs of a folder, and the rig as its maker states it.

    **Arguments:** `system` is `FILE.py:CLASS`, in the place of that of the rig file.

    **Returns:** a `Case`, and a `Rig` or a `Setup`.

    **Raises:** `ValueError` that names the file at fault and the fix.
    """
    from ..fitting import is_setup, read_setup
    from ..recordings import read_case, read_rig

    usual = case / "rig.toml" if rig is None else rig
    if system is not None or (usual.is_file() and is_setup(usual)):
        setup = read_setup(_rig_file(case, rig), system)
        return read_case(case, channels=setup.channels, gaps=gaps), setup  # pyright: ignore
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
