"""The pages of the API name everything that is public, and nothing else."""

import ast
import re
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]


def _exported(package: str) -> set[str]:
    """Names that an `__init__.py` re-exports as `from ._x import Y as Y`."""
    source = (ROOT / package.replace(".", "/") / "__init__.py").read_text("utf-8")
    imports = [n for n in ast.parse(source).body if isinstance(n, ast.ImportFrom)]
    names = [alias for node in imports for alias in node.names]
    return {alias.asname for alias in names if alias.asname == alias.name}


@pytest.mark.parametrize(
    "package",
    [
        "jaxcam.hybrid",
        "jaxcam.models",
        "jaxcam.parameters",
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
    ],
)
def test_every_public_name_has_its_place(package):
    page = ROOT / "docs" / "api" / f"{package.removeprefix('jaxcam.')}.md"
    directive = rf"^::: {re.escape(package)}\.(\w+)$"
    shown = set(re.findall(directive, page.read_text("utf-8"), re.MULTILINE))
    assert shown == _exported(package)
