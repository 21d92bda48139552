"""The report of `jaxcam demo`: one self-contained HTML file."""

import base64
import dataclasses
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path

from ..recordings.against_model import Row
from ._demo_branches import Branches, HEADINGS as HEADINGS_OF_BRANCHES
from ._rests import HEADINGS, rest_rows, Rests


@dataclasses.dataclass(frozen=True)
class Report:
    """The content of the page, in the order in which it appears."""

    title: str
    sentence: str
    lacks: str | None
    branches: Branches | None
    runs: Sequence[str]
    comparison: Sequence[Row]
    rests: Sequence[Rests]
    figures: Sequence[tuple[Path, str]]
    next_steps: Sequence[tuple[str, str]]


STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #ffffff; --quiet: #57606a;
  --line: #d0d7de; --shade: #f3f5f7; --link: #0063a0; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e9ed; --paper: #14181d; --quiet: #9aa5b1; --line: #39424d;
    --shade: #1f252c; --link: #6cb6e8; }
  /* figures are drawn on white: exchange light and dark, keep the hues, and let what
     was white show the page */
  img { filter: invert(1) hue-rotate(180deg); mix-blend-mode: screen; opacity: .92; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 56rem; padding: 1.2rem 1rem 4rem; color: var(--ink);
  background: var(--paper); font: 1rem/1.55 system-ui, sans-serif; }
h1 { font-size: 1.5rem; line-height: 1.25; }
h2 { font-size: 1.15rem; margin-top: 2.4rem; }
a { color: var(--link); }
.sentence { font-size: 1.1rem; border-left: 4px solid #0072b2; padding-left: .9rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: .4rem .6rem; text-align: right; white-space: nowrap;
  border-bottom: 1px solid var(--line); }
th { color: var(--quiet); font-weight: 600; white-space: normal; }
.text { text-align: left; }
td.text:last-child { white-space: normal; min-width: 18rem; }
.many td.text { white-space: normal; }
figure { margin: 1.8rem 0; }
img { display: block; max-width: 100%; height: auto; }
figcaption, .note { color: var(--quiet); font-size: .92rem; margin-top: .4rem; }
figcaption { max-width: 46rem; }
sup { line-height: 0; }
pre { background: var(--shade); padding: .7rem .9rem; border-radius: 6px;
  white-space: pre-wrap; overflow-wrap: anywhere; margin: .9rem 0 .2rem; }
/* a line of a command ends between words, never at the hyphens of an option */
pre span { display: inline-block; max-width: 100%; }
@media (max-width: 34rem) {
  table { font-size: .8rem; }
  th, td { padding: .35rem .25rem; white-space: normal; }
  td.text:last-child { min-width: 0; }
  /* a row with many cells becomes a list of its cells, each with its heading */
  .many thead, .many td:empty { display: none; }
  .many tr { display: block; padding: .5rem 0; border-bottom: 1px solid var(--line); }
  .many td { display: flex; justify-content: space-between; gap: 1.2rem; border: 0;
    padding: .1rem 0; font-size: .9rem; text-align: right; }
  .many td::before { content: attr(data-of); color: var(--quiet); text-align: left; }
  .many td:first-child { font-weight: 600; } }
"""


def _lacks(summary: str | None) -> list[str]:
    """Summarise the model discrepancy, with a link to the details."""
    if summary is None:
        return []
    return [
        "<h2>Model discrepancy</h2>",
        *(f'<p class="sentence">{prose(s)}</p>' for s in sentences(summary)),
        '<p class="note"><a href="diagnosis/index.html">Details of the diagnosis</a>: '
        "the fits without and with the missing effects, other explanations, and "
        "detection limits."
        "</p>",
    ]


def _branches(found: Branches | None) -> list[str]:
    """Return the section on two branches of periodic orbits and their bifurcations."""
    if found is None:
        return []
    return [
        "<h2>Periodic orbits of the thesis rig</h2>",
        figure_html(found.figure, found.caption),
        table_html(HEADINGS_OF_BRANCHES, found.rows, text=(0, 1)),
    ]


def page(report: Report) -> str:
    """Return the page as HTML text that needs no other files."""
    parts = [
        f"<h1>{escape(report.title)}</h1>",
        *_lacks(report.lacks),
        "<h2>Recording and simulation</h2>",
        # one statement per line is easier to read than a paragraph of numbers
        *(f'<p class="sentence">{prose(s)}</p>' for s in sentences(report.sentence)),
        *_branches(report.branches),
        "<h2>Residuals by mode</h2>",
        table_html(_MODES, [_cells(row) for row in report.comparison], text=(0, 6)),
        '<p class="note">Each simulated flight starts from the measured initial state, '
        "so the residual shows what the model lacks in that mode. The ratio is the "
        "residual in units of the sensor noise: 1 where nothing is missing. The pieces "
        "are flights, contacts or impacts; the last column gives the place of the most "
        "significant deviation.</p>",
        "<h2>Contact intervals</h2>",
        table_html(
            HEADINGS, [row for one in report.rests for row in rest_rows(one)], (0, 1)
        ),
        '<p class="note">The simulation uses the parameters of the rig file and the '
        "mean speed of the recording, and starts twenty cycles earlier. Angles are cam "
        "angles; ± is the standard deviation over the contacts. If simulation and "
        "recording differ completely, the rig may be on another attractor that "
        "coexists at the same speed.</p>",
        "<h2>Figures</h2>",
        *(figure_html(file, caption) for file, caption in report.figures),
        "<h2>Recordings</h2>",
        f"<ul>{''.join(f'<li>{escape(run)}</li>' for run in report.runs)}</ul>",
        "<h2>Next: your own system, your own recording</h2>",
        *(
            f'<pre>{_words(command)}</pre><p class="note">{escape(purpose)}</p>'
            for command, purpose in report.next_steps
        ),
    ]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(report.title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        "<body>\n" + "\n".join(parts) + "\n</body>\n</html>\n"
    )


_MODES = ("mode", "ratio", "rms", "noise", "unit", "pieces", "most significant at")


def _cells(row: Row) -> tuple[str, ...]:
    rms, noise, unit = row.shown()
    numbers = (f"{row.ratio:.2f}", rms, noise)
    place = f"{row.worst_record}, {row.worst_time:.3f} s"
    if row.worst_phase == row.worst_phase:
        place += f", cam at {row.worst_phase:.2f} rad"
    return (row.mode, *numbers, unit, str(row.count), place)


# more columns than this do not fit a telephone
_FEW = 5


def table_html(
    headings: Sequence[str], rows: Sequence[Sequence[str]], text: Sequence[int]
) -> str:
    many = len(headings) > _FEW

    def line(tag: str, cells: Sequence[str]) -> str:
        marked = (
            f"<{tag}{' class=text' if k in text else ''}"
            f"{_heading(headings[k]) if many and tag == 'td' else ''}>"
            f"{prose(cell)}</{tag}>"
            for k, cell in enumerate(cells)
        )
        return f"<tr>{''.join(marked)}</tr>"

    body = "".join(line("td", row) for row in rows)
    head = f"<thead>{line('th', headings)}</thead>"
    kind = "wide many" if many else "wide"
    return f'<div class="{kind}"><table>{head}<tbody>{body}</tbody></table></div>'


def _heading(text: str) -> str:
    return f' data-of="{escape(text)}"'


# at this size, letters of figures are as large as those of captions
_CSS_PIXELS = 96


def figure_html(file: Path, caption: str) -> str:
    from PIL import Image

    content = file.read_bytes()
    data = base64.b64encode(content).decode("ascii")
    with Image.open(file) as image:
        width = round(image.width / image.info["dpi"][0] * _CSS_PIXELS)
    return (
        f'<figure><img width="{width}" alt="{escape(caption)}" '
        f'src="data:image/png;base64,{data}">'
        f"<figcaption>{prose(caption)}</figcaption></figure>"
    )


def prose(text: str) -> str:
    """Return a text as HTML, with signs and powers typeset."""
    return re.sub(r"\^(-?\d+)", r"<sup>\1</sup>", escape(text).replace("+-", "±"))


def _words(command: str) -> str:
    """Return a command as HTML in which each word is an element."""
    return " ".join(f"<span>{escape(word)}</span>" for word in command.split(" "))


def sentences(sentence: str) -> list[str]:
    """Split a text into sentences, at a full stop before a capital letter."""
    lines, begin = [], 0
    for k in range(len(sentence) - 2):
        if sentence[k : k + 2] == ". " and sentence[k + 2].isupper():
            lines.append(sentence[begin : k + 1])
            begin = k + 2
    return [*lines, sentence[begin:]]
