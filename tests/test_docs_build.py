"""The documentation's build fails where a reference leads nowhere."""

import importlib.util
import shlex
import subprocess
import sys
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]

needs_mkdocs = pytest.mark.skipif(
    importlib.util.find_spec("mkdocs") is None,
    reason="needs mkdocs: python -m pip install -e '.[docs]'",
)


def _build(text: str, folder: Path) -> subprocess.CompletedProcess:
    """Build one page with this text by the command and settings of `.ci/run`."""
    (line,) = [
        line
        for line in (ROOT / ".ci" / "run").read_text("utf-8").splitlines()
        if line.startswith("mkdocs build")
    ]
    settings = (ROOT / "mkdocs.yml").read_text("utf-8")
    before, rest = settings.split("\nnav:\n")
    after = rest[rest.index("markdown_extensions:") :]
    (folder / "docs").mkdir()
    (folder / "docs" / "index.md").write_text(text, "utf-8")
    (folder / "mkdocs.yml").write_text(before + after, "utf-8")
    site = str(folder / "site")
    words = [site if "$work" in word else word for word in shlex.split(line)]
    return subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, capture_output=True, text=True
    )


@needs_mkdocs
@pytest.mark.parametrize(
    "text, builds",
    [
        ("A page.", True),
        ("See [`nothing.there`][].", False),
        ("See [a page](absent.md).", False),
        ("See [a place](#absent).", False),
        ("See [a place](/absent/).", False),
        ('--8<-- "absent.md"', False),
    ],
)
def test_a_broken_reference_fails_the_build(text, builds, tmp_path):
    done = _build(f"# Title\n\n{text}\n", tmp_path)
    assert (done.returncode == 0) == builds, done.stderr
