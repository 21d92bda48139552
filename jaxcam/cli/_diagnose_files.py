"""What a diagnosis leaves behind: verdict, model and report."""

from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from ..discrepancy import Diagnosis, Prediction
from ..models import save_system
from ._diagnose_page import diagnosis_page, draw
from ._output import to_text
from ._predictions import as_data


# Each figure's file and caption
Figures: TypeAlias = list[tuple[Path, str]]


def write_diagnosis(folder: Path, found: Diagnosis, notes: Sequence[str]) -> Figures:
    """Write verdict.json, model.json and index.html with its figures to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    about = {"case": found.case, "summary": found.summary}
    save_system(found.system(), folder / "model.json", about=about)
    figures = draw(folder, found)
    write_verdict(folder, found, figures, notes)
    return figures


def write_verdict(
    folder: Path,
    found: Diagnosis,
    figures: Figures,
    notes: Sequence[str],
    foretold: Sequence[Prediction] = (),
) -> None:
    """Write verdict.json, and index.html with figures that are drawn already."""
    verdict = to_text({**found.to_json(), **as_data(foretold)})
    (folder / "verdict.json").write_text(verdict + "\n", encoding="utf-8")
    page = diagnosis_page(found, figures, tuple(notes), foretold)
    (folder / "index.html").write_text(page, encoding="utf-8")
