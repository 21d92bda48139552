"""Output of a command: the terminal, a JSON file, a folder of figures."""

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from ._lock import hold


# a width that exceeds that of any table (characters)
_WIDEST = 10_000


class Output:
    """The outputs of one command: the terminal, `--json FILE` and `--out DIR`.

    Unwritable paths are reported before the work begins.

    Raises:
        ValueError: A path is of the wrong kind.
        OSError: A path cannot be written.
    """

    def __init__(self, json_file: Path | None, folder: Path | None):
        self.json_file = json_file
        self.folder = folder
        self.to_stdout = str(json_file) == "-"
        if folder is not None:
            if folder.exists() and not folder.is_dir():
                raise ValueError(f"{folder}: this is a file; give --out a folder.")
            _make(folder)
            hold(folder)
            _try(folder / ".jaxcam-can-write")
        if json_file is not None and not self.to_stdout:
            if json_file.is_dir():
                raise ValueError(
                    f"{json_file}: this is a folder; give --json a file in it."
                )
            _make(json_file.parent)
            if not json_file.exists():
                _try(json_file)
            elif json_file.is_file():
                _try(_beside(json_file))
        # with `--json -`, only JSON goes to standard output
        self.console = Console(quiet=self.to_stdout, highlight=False)

    def print(self, *what) -> None:
        """Print tables and sentences to the terminal.

        A table that is wider than the terminal is not truncated.
        """
        wide = self.console.options.update(max_width=_WIDEST)
        needed = [
            Measurement.get(self.console, wide, one).minimum
            for one in what
            if isinstance(one, Table)
        ]
        width = max(self.console.width, *needed) if needed else None
        self.console.print(*what, markup=False, width=width, crop=not needed)

    def print_figures(self, files: Sequence[Path]) -> None:
        """Print the location of the figures, if any."""
        if files:
            self.print(f"Figures: {', '.join(map(str, files))}")

    def write_json(self, found: dict[str, Any]) -> None:
        """Write the result to the file given by `--json`."""
        if self.json_file is None:
            return
        text = to_text(found)
        if self.to_stdout:
            typer.echo(text)
        else:
            write_text(self.json_file, text + "\n")
            self.print(f"Data: {self.json_file}")


def write_text(file: Path, text: str) -> None:
    """Write a file atomically: a killed run leaves either the old file or the new
    one.
    """
    if file.exists() and (file.is_symlink() or not file.is_file()):
        # write to a device or through a link directly, so that it is not replaced
        file.write_text(text, encoding="utf-8")
        return
    part = _beside(file)
    try:
        part.write_text(text, encoding="utf-8")
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)


def _beside(file: Path) -> Path:
    """Return a temporary path next to a file."""
    return file.with_name(f"{file.name[:200]}.{os.getpid()}.part")


def to_text(found: dict[str, Any]) -> str:
    """Return valid JSON, with null for non-finite numbers."""
    return json.dumps(_plain(found), indent=1, allow_nan=False, ensure_ascii=False)


def _plain(value):
    if isinstance(value, dict):
        return {str(name): _plain(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if hasattr(value, "dtype"):
        return _plain(np.asarray(value).tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ValueError(
            f"{folder}: a part of this path is a file; choose another folder."
        ) from None


def _try(file: Path) -> None:
    file.touch()
    file.unlink()
