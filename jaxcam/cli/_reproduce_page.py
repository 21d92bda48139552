"""The page of `jaxcam reproduce`: one HTML file with all tables and figures."""

import math
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path

from ..thesis import TARGETS
from ._page import figure_html, STYLE, table_html
from ._reproduce_record import Origin, TargetRecord


HEADINGS = ("quantity", "printed", "computed", "difference", "relative", "unit")
_OVERVIEW = (
    "target",
    "title",
    "largest relative difference",
    "values compared",
    "time",
)
_MORE = """
nav a { display: inline-block; padding: .15rem .45rem .15rem 0; color: inherit; }
section { border-top: 1px solid var(--line); margin-top: 2.4rem; }
section h2 { margin-top: 1.2rem; }
td.text { white-space: normal; min-width: 8rem; }
"""
"""Style of this page, in addition to the common style."""
_CHAPTERS = {
    "1": "Introduction",
    "2": "Smooth and nonsmooth dynamical systems",
    "3": "Numerical methods",
    "4": "The cam-follower and its rig",
    "5": "Numerical bifurcation analysis",
    "6": "Chatter and its interruption",
}


def cells(row) -> tuple[str, ...]:
    """Return the cells of a row as text, in the order of `HEADINGS`."""
    printed, lost = math.isfinite(row.printed), not math.isfinite(row.computed)
    both = printed and not lost
    relative = both and math.isfinite(row.relative)
    return (
        row.quantity,
        f"{row.printed:.10g}" if printed else "",
        "none" if lost else f"{row.computed:.10g}",
        f"{row.difference:+.2e}" if both else "",
        f"{row.relative:+.1e}" if relative else "",
        row.unit,
    )


def write_page(
    folder: Path, records: Sequence[TargetRecord], settings: Origin, of: int
) -> Path:
    """Write `index.html`, replacing an existing file atomically.

    **Arguments:** `of`: total number of targets.
    """
    part = folder / "index.html.part"
    part.write_text(_page(folder, records, settings, of), encoding="utf-8")
    os.replace(part, folder / "index.html")
    return folder / "index.html"


def _page(folder, records, settings, of) -> str:
    title = "Tables and figures of the thesis (Alzate, 2008), printed and computed"
    failed = [record.name for record in records if record.error is not None]
    minutes = sum(record.seconds for record in records) / 60
    sentence = (
        f"{len(records)} of {of} targets, {minutes:.1f} minutes of computing time"
    )
    sentence += f"; {len(failed)} failed: {', '.join(failed)}." if failed else "."
    parts = [
        f"<h1>{title}</h1>",
        f'<p class="sentence">{escape(sentence)}</p>',
        f'<p class="note">jaxcam {escape(settings.version)}, rig '
        f"{escape(settings.preset)}, size {escape(settings.size)}. Relative "
        "differences refer to the magnitude of the printed value. Where no printed "
        "value is shown, the thesis gives only a drawing.</p>",
    ]
    for chapter, words in _CHAPTERS.items():
        own = [r for r in records if r.name.partition("-")[2].startswith(chapter)]
        if own:
            links = " ".join(f'<a href="#{r.name}">{r.name}</a>' for r in own)
            parts.append(f"<nav><strong>{chapter} {words}</strong><br>{links}</nav>")
    rows = [_overview(record) for record in records]
    parts += ["<h2>Overview</h2>", table_html(_OVERVIEW, rows, text=(0, 1))]
    parts += [_section(folder, record) for record in records]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{STYLE}{_MORE}</style>\n</head>\n"
        "<body>\n" + "\n".join(parts) + "\n</body>\n</html>\n"
    )


def _overview(record: TargetRecord) -> tuple[str, ...]:
    title = TARGETS[record.name].title
    if record.error is not None:
        return record.name, title, "failed", "", f"{record.seconds:.0f} s"
    sizes = [abs(row["relative"]) for row in record.rows]
    sizes = [size for size in sizes if math.isfinite(size)]
    compared = sum(math.isfinite(row["difference"]) for row in record.rows)
    largest = f"{max(sizes):.1e}" if sizes else ""
    return record.name, title, largest, str(compared), f"{record.seconds:.0f} s"


def _section(folder: Path, record: TargetRecord) -> str:
    target = TARGETS[record.name]
    parts = [f"<h2>{escape(record.name)}: {escape(target.title)}</h2>"]
    if record.error is not None:
        parts.append(f'<p class="sentence">Failed: {escape(record.error)}</p>')
    if record.rows:
        rows = [cells(row) for row in record.table.itertuples(index=False)]
        parts.append(table_html(HEADINGS, rows, text=(0,)))
    if record.figure:
        parts.append(figure_html(folder / f"{record.name}.png", target.title))
    if target.note:
        parts.append(f'<p class="note">{escape(target.note)}</p>')
    return f'<section id="{record.name}">' + "\n".join(parts) + "</section>"
