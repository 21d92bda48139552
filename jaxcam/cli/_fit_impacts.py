"""`jaxcam fit TABLE.csv`: fit a restitution law to a table of impacts."""

from pathlib import Path

from rich.table import Table

from ._files_options import Files
from ._output import Output


def is_table(case: Path, files: Files) -> bool:
    """Return whether a file is a table with one impact per row."""
    from ..recordings.files import is_impact_table

    return case.is_file() and is_impact_table(case, files.named())


def fit_impacts(case: Path, files: Files, json_file: Path | None) -> None:
    """Print the restitution laws fitted to the impacts, and write them to a JSON file.

    Raises:
        ValueError: The table is invalid; the message names the row and a fix.
    """
    from ..fitting import impact_law
    from ..recordings import read_impacts

    found = impact_law(read_impacts(case, columns=files.named()))
    output = Output(json_file, None)
    table = Table(title="Restitution laws")
    table.add_column("law", no_wrap=True)
    for heading in ("parameters", "delta BIC"):
        table.add_column(heading, justify="right")
    for name, gain in found.delta_bic.items():
        law = found.laws.get(name)
        cells = "same as the constant law"
        if law is not None:
            rows = zip(law.names, law.values, law.stderr)
            cells = ", ".join(f"{n} = {v:.5g} +- {e:.1g}" for n, v, e in rows)
        table.add_row(name, cells, f"{gain:+.1f}")
    output.print(table)
    for sentence in found.sentences():
        output.print(sentence)
    output.write_json(found.to_json())
