"""Arrows between the rooms point down, file by file, and no module is too long."""

import ast
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]
FLOOR = {
    "hybrid": set(),
    "filippov": {"hybrid"},
    "models": {"hybrid", "filippov"},
    "timestepping": {"hybrid"},
    "maps": {"hybrid"},
    "recordings": {"hybrid", "models"},
    "variational": {"hybrid", "filippov", "models"},
    "fitting": {"hybrid", "models", "recordings", "variational"},
    "continuation": {"hybrid", "variational"},
    "sweeps": {"hybrid", "models", "variational"},
    "discrepancy": {"hybrid", "models", "recordings", "fitting", "variational"},
}
#: what may be imported from everywhere below, and from nowhere above
_LAST = {"thesis", "plotting", "cli", "data"}
#: what names everything
_DOORS = {"", "_citation", "__main__"}


def _room(module: str) -> str:
    parts = module.split(".")
    if parts[0] in ("variational", "continuation"):
        return parts[0]
    return parts[1] if len(parts) > 1 else ""


def _imports(file: Path):
    """Modules that a file imports, by their full names."""
    package = list(file.relative_to(ROOT).parts[:-1])
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            if node.module:
                yield ".".join([*base, node.module])
            else:
                yield from (".".join([*base, one.name]) for one in node.names)


def _files(room: str):
    folder = room if room in ("variational", "continuation") else f"jaxcam/{room}"
    return sorted((ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("room", FLOOR)
def test_arrows_point_down(room):
    files = _files(room)
    assert files
    for file in files:
        for module in _imports(file):
            if module.split(".")[0] not in ("jaxcam", "variational", "continuation"):
                continue
            seen = _room(module)
            allowed = FLOOR[room] | _DOORS | {room}
            assert seen in allowed, f"{file.relative_to(ROOT)} imports {module}"


@pytest.mark.parametrize("room", [*FLOOR, "thesis", "plotting"])
def test_nobody_below_imports_the_command_line(room):
    for file in _files(room):
        rooms = {_room(m) for m in _imports(file) if m.startswith("jaxcam")}
        assert "cli" not in rooms, file
        if room != "plotting":
            assert "plotting" not in rooms, file


def test_every_room_has_its_place():
    rooms = {
        p.name for p in (ROOT / "jaxcam").iterdir() if (p / "__init__.py").exists()
    }
    assert rooms <= set(FLOOR) | _LAST


def test_modules_can_be_read_at_one_go():
    """At most 360 lines, where 50 to 250 are wanted."""
    for folder in ("jaxcam", "variational", "continuation"):
        for file in (ROOT / folder).rglob("*.py"):
            assert len(file.read_text().splitlines()) <= 360, file
