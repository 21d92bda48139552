"""Arrows between the rooms point down, file by file, and no module is too long."""

import ast
import graphlib
import subprocess
import sys
from pathlib import Path

import pytest


ROOT = Path(__file__).parents[1]
FLOOR = {
    "parameters": set(),
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
#: the rooms above all of these, of which `thesis` draws its figures with `plotting`
_LAST = {"thesis", "plotting", "cli", "data"}
#: what names everything
_DOORS = {"", "_citation", "__main__"}


ROOMS = [*FLOOR, *sorted(_LAST)]


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
            allowed = FLOOR[room] | _DOORS | {room, "parameters", "tables"}
            assert seen in allowed, f"{file.relative_to(ROOT)} imports {module}"


@pytest.mark.parametrize("room", [*FLOOR, "thesis", "plotting"])
def test_nobody_below_imports_the_command_line(room):
    for file in _files(room):
        rooms = {_room(m) for m in _imports(file) if m.startswith("jaxcam")}
        assert "cli" not in rooms, file
        if room not in ("plotting", "thesis"):
            assert "plotting" not in rooms, file


def test_the_command_line_asks_the_thesis_by_its_public_names():
    """No file of `cli` looks behind `jaxcam.thesis`, to a module or a private name."""
    asked = set()
    for file in _files("cli"):
        for module in _imports(file):
            assert not module.startswith("jaxcam.thesis."), f"{file} imports {module}"
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module == "thesis":
                asked |= {one.name for one in node.names}
    assert asked == {"reproduce", "TARGETS"}


def test_a_target_of_the_thesis_is_one_file_in_the_folder_of_its_chapter():
    """And every such file is a target, by the name of the file."""
    from jaxcam.thesis import TARGETS

    files = [f for f in _files("thesis") if f.stem.startswith(("table_", "figure_"))]
    names = set()
    for file in files:
        kind, chapter, number = file.stem.split("_")
        assert file.parent.name.startswith(f"chapter_{chapter}_"), file
        names.add(f"{kind}-{chapter}.{number}")
    assert len(names) == len(files) and names == set(TARGETS)


def _private_imports():
    """Imports of private modules, or private names, by files that are not inside."""
    for file in (f for room in ROOMS for f in _files(room)):
        package = file.relative_to(ROOT).parts[:-1]
        for node in ast.walk(ast.parse(file.read_text())):
            if not isinstance(node, ast.ImportFrom):
                continue
            base = package[: len(package) - node.level + 1] if node.level else ()
            path = [*base, *(node.module or "").split(".")]
            if path[0] not in ("jaxcam", "variational", "continuation"):
                continue
            hidden = [k for k, name in enumerate(path) if name.startswith("_")]
            inside = not hidden or package[: hidden[0]] == tuple(path[: hidden[0]])
            names = [n.name for n in node.names if n.name.startswith("_")]
            if not inside or (names and node.module):
                yield f"{file.relative_to(ROOT)} imports {'.'.join(path)}: {names}"


def test_rooms_meet_at_their_public_names():
    """A private module is imported by files of its own folder, and of those inside."""
    assert not list(_private_imports())


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


@pytest.mark.parametrize("room", ROOMS)
def test_functions_fit_on_a_screen_or_two(room):
    """At most 100 lines, signature and docstring included."""
    for file in _files(room):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.FunctionDef):
                length = (node.end_lineno or 0) - node.lineno + 1
                assert length <= 100, f"{file}: {node.name} has {length} lines"


def _file_of(module: str) -> Path | None:
    path = ROOT / module.replace(".", "/")
    files = path.with_suffix(".py"), path / "__init__.py"
    return next((f for f in files if f.exists()), None)


def _needs(file: Path) -> set[Path]:
    """The files that a file imports, its own package's door excepted."""
    found = set()
    package = file.relative_to(ROOT).parts[:-1]
    for node in ast.walk(ast.parse(file.read_text())):
        if not isinstance(node, ast.ImportFrom):
            continue
        base = package[: len(package) - node.level + 1] if node.level else ()
        module = ".".join([*base, *filter(None, [node.module])])
        for name in node.names:
            found.add(_file_of(f"{module}.{name.name}") or _file_of(module))
    return found - {None, file}


@pytest.mark.parametrize("room", ROOMS)
def test_no_file_needs_itself(room):
    """Not by a chain of imports either, those for types alone included."""
    graph = {file: _needs(file) for file in _files(room)}
    order = graphlib.TopologicalSorter(
        {file: needed & set(graph) for file, needed in graph.items()}
    )
    try:
        order.prepare()
    except graphlib.CycleError as found:
        circle = [str(f.relative_to(ROOT)) for f in found.args[1]]
        pytest.fail(f"a circle of imports: {circle}")


def _benchmarks(file: Path):
    """Modules of `benchmarks` that a file imports."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module == "benchmarks":
            yield from (f"benchmarks.{one.name}" for one in node.names)
    yield from (one for one in _imports(file) if one.startswith("benchmarks."))


def test_tests_import_no_benchmark_that_needs_numba():
    """The extra `test` does not install it, whatever this environment has."""
    modules = sorted(
        {
            module
            for file in (ROOT / "tests").rglob("*.py")
            for module in _benchmarks(file)
        }
    )
    assert "benchmarks.named" in modules
    code = "import sys; sys.modules['numba'] = None\n"
    code += "\n".join(f"import {module}" for module in modules)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
