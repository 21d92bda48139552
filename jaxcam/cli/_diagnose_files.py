"""Write the results of a diagnosis: verdict, model and report."""

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from ..discrepancy import Diagnosis
from ._diagnosis_figures import draw
from ._diagnosis_page import diagnosis_page
from ._outlook import Outlook
from ._output import to_text, write_text
from ._saved_system import as_saved


# The file and the caption of each figure
Figures: TypeAlias = list[tuple[Path, str]]


def write_diagnosis(folder: Path, found: Diagnosis, notes: Sequence[str]) -> Figures:
    """Write verdict.json, model.json and index.html with its figures to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    about = {"case": found.case, "summary": found.summary}
    model = as_saved(found.system(), about)
    if "not_saved" in model:
        (folder / "model.json").unlink(missing_ok=True)
    else:
        write_text(folder / "model.json", to_text(model) + "\n")
    figures = draw(folder, found)
    write_verdict(folder, found, figures, notes)
    return figures


def write_verdict(
    folder: Path,
    found: Diagnosis,
    figures: Figures,
    notes: Sequence[str],
    outlook: Outlook = Outlook(),
) -> None:
    """Write verdict.json, and index.html with figures that already exist."""
    verdict = to_text({**found.to_json(), **outlook.data()})
    write_text(folder / "verdict.json", verdict + "\n")
    page = diagnosis_page(found, figures, tuple(notes), outlook)
    write_text(folder / "index.html", page)
