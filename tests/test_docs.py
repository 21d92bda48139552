"""The pages of the API name everything that is public, and nothing else.

A face is what a reader of guides, notebooks and commands meets; `jaxcam.parameters` is
a door between packages and no face.
"""

import ast
import re
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]
FACES = (
    "jaxcam.hybrid",
    "jaxcam.models",
    "jaxcam.recordings",
    "jaxcam.sweeps",
    "jaxcam.fitting",
    "jaxcam.discrepancy",
    "jaxcam.plotting",
    "jaxcam.thesis",
    "jaxcam.filippov",
    "jaxcam.timestepping",
    "jaxcam.maps",
    "variational",
    "continuation",
)


def _exported(package: str) -> set[str]:
    """Names that an `__init__.py` re-exports as `from ._x import Y as Y`."""
    source = (ROOT / package.replace(".", "/") / "__init__.py").read_text("utf-8")
    imports = [n for n in ast.parse(source).body if isinstance(n, ast.ImportFrom)]
    names = [alias for node in imports for alias in node.names]
    return {alias.asname for alias in names if alias.asname == alias.name}


def _page(package: str) -> str:
    page = ROOT / "docs" / "api" / f"{package.removeprefix('jaxcam.')}.md"
    return page.read_text("utf-8")


def _read_by_users() -> str:
    """The guides, the notebooks and the commands, as one text."""
    guides = set((ROOT / "docs").glob("*.md")) - {ROOT / "docs" / "structure.md"}
    programs = [*(ROOT / "notebooks").glob("*.py"), *(ROOT / "jaxcam/cli").glob("*.py")]
    files = [*sorted(guides), ROOT / "README.md", *sorted(programs)]
    return "\n".join(file.read_text("utf-8") for file in files)


@pytest.mark.parametrize("package", FACES)
def test_every_public_name_has_its_place(package):
    directive = rf"^::: {re.escape(package)}\.(\w+)$"
    shown = set(re.findall(directive, _page(package), re.MULTILINE))
    assert shown == _exported(package)


def test_every_public_name_is_met_in_a_guide_a_notebook_or_a_command():
    words = set(re.findall(r"\w+", _read_by_users()))
    unmet = [f"{p}.{name}" for p in FACES for name in sorted(_exported(p) - words)]
    assert not unmet


@pytest.mark.parametrize("package", [*FACES, "jaxcam.parameters"])
def test_a_reader_finds_a_name_under_a_short_heading(package):
    """Grouped by what a reader wants, at most eight names under each heading."""
    for part in re.split(r"^#+ ", _page(package), flags=re.MULTILINE):
        names = re.findall(r"^::: ", part, re.MULTILINE)
        assert len(names) <= 8, part.splitlines()[0]
