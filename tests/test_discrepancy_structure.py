"""The rooms of `jaxcam.discrepancy`: one door each, and arrows that point down."""

import ast
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "jaxcam" / "discrepancy"
#: each room may import those before it
ROOMS = ("terms", "search", "evidence", "report")


def _imports(file: Path):
    """Full names of the modules that a file imports from, relative ones resolved."""
    package = list(file.relative_to(ROOT).parts[:-1])
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (one.name.split(".") for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            yield base + (node.module.split(".") if node.module else [])


def _files():
    files = sorted(PACKAGE.rglob("*.py"))
    assert len(files) > 20
    return files


def test_only_doors_of_other_rooms_and_packages_are_used():
    """A private module is imported by its own folder alone."""
    for file in _files():
        home = list(file.relative_to(ROOT).parts[:-1])
        for module in _imports(file):
            if module[0] not in ("jaxcam", "variational", "continuation"):
                continue
            for k, part in enumerate(module):
                if part.startswith("_"):
                    assert module[:k] == home, f"{file.name} imports {module}"


@pytest.mark.parametrize("room", ROOMS)
def test_rooms_import_only_those_before_them(room):
    before = set(ROOMS[: ROOMS.index(room)])
    for file in sorted((PACKAGE / room).glob("*.py")):
        for module in _imports(file):
            if module[:2] != ["jaxcam", "discrepancy"] or len(module) < 3:
                continue
            assert module[2] in before | {room, "policy"}, f"{file.name}: {module}"


def test_functions_of_the_package_fit_on_a_screen():
    """At most 100 lines; `diagnose` was one of 152."""
    for file in _files():
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef):
                length = (node.end_lineno or 0) - node.lineno + 1
                assert length <= 100, f"{file.name}: {node.name} has {length} lines"
