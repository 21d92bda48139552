"""What a diagnosis leaves behind: verdict, model and report."""

from collections.abc import Sequence
from pathlib import Path

from ..discrepancy import Diagnosis
from ..models import save_system
from ._diagnose_page import diagnosis_page, draw
from ._output import to_text


def write_diagnosis(folder: Path, found: Diagnosis, notes: Sequence[str]) -> None:
    """Write verdict.json, model.json and index.html with its figures to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    figures = draw(folder, found)
    page = diagnosis_page(found, figures, tuple(notes))
    (folder / "index.html").write_text(page, encoding="utf-8")
    (folder / "verdict.json").write_text(to_text(found.to_json()) + "\n", "utf-8")
    about = {"case": found.case, "summary": found.summary}
    save_system(found.system(), folder / "model.json", about=about)
