"""What the tour and the questions print is run, not believed."""

import re
from pathlib import Path

import pytest


DOCS = Path(__file__).parents[1] / "docs"


def blocks(page: str) -> list[tuple[str, str | None]]:
    """Code blocks in their order, each with the output shown right below it."""
    text = (DOCS / page).read_text(encoding="utf-8")
    pattern = r"^```python\n(.*?)^```$(?:\n\n^```text\n(.*?)^```$)?"
    return re.findall(pattern, text, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize(
    "page",
    [
        pytest.param("tour.md", marks=pytest.mark.slow),
        pytest.param("filippov.md", marks=pytest.mark.slow),
        "faq.md",
    ],
)
def test_examples_print_what_is_shown(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "docs"}
    found = blocks(page)
    assert found
    for number, (code, shown) in enumerate(found, start=1):
        exec(compile(code, f"{page}, block {number}", "exec"), names)
        assert capsys.readouterr().out == shown, f"{page}, block {number}"
