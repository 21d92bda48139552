"""Write the report of a diagnosis from Python."""

from pathlib import Path
from typing import TYPE_CHECKING


if TYPE_CHECKING:
    from ..discrepancy import Diagnosis


def write_report(found: "Diagnosis", folder: str | Path) -> Path:
    """Write the report of a diagnosis, as `jaxcam diagnose --out FOLDER` does.

    Args:
        found: The diagnosis.
        folder: The folder, which is created if necessary; the files `index.html`,
            `verdict.json`, `model.json` and the figures in it are overwritten.

    Returns:
        The path of `index.html`.
    """
    # imported here, so that other commands need not load the diagnosis
    from ._diagnose_files import write_diagnosis

    where = Path(folder)
    write_diagnosis(where, found, ())
    return where / "index.html"
