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


@pytest.mark.parametrize("room", ["hybrid", "models", "recordings", "plotting"])
def test_every_public_name_has_its_place(room):
    page = (ROOT / "docs" / "api" / f"{room}.md").read_text("utf-8")
    shown = set(re.findall(rf"^::: jaxcam\.{room}\.(\w+)$", page, re.MULTILINE))
    assert shown == _exported(f"jaxcam.{room}")
