"""The pages of the API are complete, and the examples on them run.

Every name on a page of `docs/api` is checked: a function describes each argument and
its result, a class each of its fields, and a method begins by what it returns. Every
function, and every class that a package exports, has an example in the form of a
doctest; the few that take minutes have theirs in a guide.
"""

import ast
import doctest
import functools
import io
import re
from collections.abc import Iterator
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib import pyplot as plt

import jaxcam


ROOT = Path(__file__).parents[1]
# what an example may use without importing it
GIVEN = {"jax": jax, "jnp": jnp, "np": np, "jaxcam": jaxcam}
# the guide with the example of a function; a diagnosis takes minutes
IN_A_GUIDE = {
    "jaxcam.discrepancy.diagnose": "discrepancy.md",
    "jaxcam.discrepancy.predictions": "discrepancy.md",
    "jaxcam.discrepancy.event_causes": "discrepancy.md",
    "jaxcam.discrepancy.next_experiments": "discrepancy.md",
    "jaxcam.discrepancy.compare_experiments": "discrepancy.md",
    # starts processes, and needs an optional package
    "jaxcam.sweeps.cluster": "sweeps.md",
}
# classes that are only returned by functions
RETURNED = {
    "jaxcam.discrepancy.Diagnosis",
    "jaxcam.fitting.FreeRun",
    "jaxcam.fitting.FreeRunFit",
}
# each of its settings states its meaning where it is defined, for `Policy.settings`
SETTINGS = {"jaxcam.discrepancy.Policy"}
# quick to compile; the examples of all other packages are slow
QUICK = (
    "jaxcam.maps.",
    "jaxcam.parameters.",
    "jaxcam.citation",
    "jaxcam.models.",
    "jaxcam.filippov.modes.",
    "jaxcam.fitting.own_systems.",
    "jaxcam.recordings.files.",
    "jaxcam.timestepping.relay.is_p_matrix",
)


@functools.cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text("utf-8"))


def _module(parts: list[str]) -> Path | None:
    path = ROOT.joinpath(*parts)
    files = path / "__init__.py", path.with_suffix(".py")
    return next((file for file in files if file.exists()), None)


def _look_up(file: Path, name: str) -> ast.AST | None:
    """The definition of a name of a module, or of what it imports by that name."""
    for node in _tree(file).body:
        if getattr(node, "name", None) == name:
            return node
    for node in _tree(file).body:
        if not isinstance(node, ast.ImportFrom):
            continue
        for alias in node.names:
            if (alias.asname or alias.name) == name:
                package = list(file.relative_to(ROOT).parts[:-1])
                base = package[: len(package) - node.level + 1] if node.level else []
                found = _module([*base, *(node.module or "").split(".")])
                return _look_up(found, alias.name) if found else None
    return None


def _definition(name: str) -> ast.AST | None:
    *package, last = name.split(".")
    file = _module(package)
    assert file is not None, f"{name}: there is no module of this name"
    return _look_up(file, last)


def _names() -> list[str]:
    pages = sorted((ROOT / "docs" / "api").glob("*.md"))
    text = "\n".join(page.read_text("utf-8") for page in pages)
    return list(dict.fromkeys(re.findall(r"^::: (\S+)", text, re.MULTILINE)))


DEFINED = {name: _definition(name) for name in _names()}
FUNCTIONS = {k: v for k, v in DEFINED.items() if isinstance(v, ast.FunctionDef)}
CLASSES = {k: v for k, v in DEFINED.items() if isinstance(v, ast.ClassDef)}
METHODS = {
    f"{name}.{node.name}": node
    for name, cls in CLASSES.items()
    for node in cls.body
    if isinstance(node, ast.FunctionDef)
}
DOCUMENTED = {**FUNCTIONS, **CLASSES, **METHODS}
PACKAGES = (
    "jaxcam",
    "variational",
    "continuation",
    *[
        f"jaxcam.{folder.name}"
        for folder in (ROOT / "jaxcam").iterdir()
        if (folder / "__init__.py").exists()
    ],
)


def _arguments(function: ast.FunctionDef) -> list[str]:
    found = function.args
    named = [*found.posonlyargs, *found.args, *found.kwonlyargs]
    rest = [one for one in (found.vararg, found.kwarg) if one is not None]
    return [one.arg for one in [*named, *rest] if one.arg not in ("self", "cls")]


def _described(doc: str) -> set[str]:
    section = re.search(r"^Args:\n((?:    .*\n?|\n)*)", doc, re.MULTILINE)
    text = section[1] if section else ""
    return set(re.findall(r"^    \*{0,2}(\w+):", text, re.MULTILINE))


def _own(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a function without those of functions inside it."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.FunctionDef | ast.Lambda):
            yield child
            yield from _own(child)


def _returns(function: ast.FunctionDef) -> bool:
    if function.returns is not None:
        return ast.unparse(function.returns) != "None"
    values = (n for n in _own(function) if isinstance(n, ast.Return | ast.Yield))
    return any(node.value is not None for node in values)


def _doc(node: ast.FunctionDef | ast.ClassDef) -> str:
    return ast.get_docstring(node) or ""


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_describes_its_arguments_and_what_it_returns(name):
    doc = _doc(FUNCTIONS[name])
    assert doc
    missing = set(_arguments(FUNCTIONS[name])) - _described(doc)
    assert not missing, f"no description of {sorted(missing)}"
    assert "Returns:" in doc or not _returns(FUNCTIONS[name])


def _is_text(node: ast.AST | None) -> bool:
    constant = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    return constant and isinstance(node.value.value, str)


@pytest.mark.parametrize("name", sorted(set(CLASSES) - SETTINGS))
def test_a_class_describes_its_fields(name):
    assert _doc(CLASSES[name])
    body = CLASSES[name].body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            field = node.target.id
            assert field.startswith("_") or _is_text(after), f"{field} is not described"


@pytest.mark.parametrize("name", CLASSES)
def test_a_method_says_what_it_returns(name):
    for node in CLASSES[name].body:
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
            continue
        doc, marks = _doc(node), [ast.unparse(mark) for mark in node.decorator_list]
        if not doc or not _returns(node) or any("property" in m for m in marks):
            # what is overridden is described where it is declared
            continue
        assert re.match("Return|Yield", doc) or "Returns:" in doc, node.name


@pytest.mark.parametrize("name", {**FUNCTIONS, **CLASSES})
def test_a_summary_does_not_open_like_a_question(name):
    doc = _doc(DEFINED[name])
    assert not re.match(r"(What|How|Where|Why|Which|When|Whether)\b", doc), doc


def _exported(name: str) -> bool:
    return name.rpartition(".")[0] in PACKAGES


@pytest.mark.parametrize("name", sorted(set(filter(_exported, CLASSES)) - RETURNED))
def test_an_exported_class_has_an_example(name):
    assert ">>> " in _doc(CLASSES[name])


@pytest.mark.parametrize("name", sorted(set(FUNCTIONS) - set(IN_A_GUIDE)))
def test_a_function_has_an_example(name):
    assert ">>> " in _doc(FUNCTIONS[name])


@pytest.mark.parametrize(("name", "guide"), IN_A_GUIDE.items())
def test_the_example_of_a_slow_function_is_in_the_guide_that_it_names(name, guide):
    doc = _doc(FUNCTIONS[name])
    assert f"](../{guide}" in doc and ">>> " not in doc
    code = re.compile(rf"\b{name.rpartition('.')[2]}\((?!\))")
    assert code.search((ROOT / "docs" / guide).read_text("utf-8"))


EXAMPLES = [name for name, node in DOCUMENTED.items() if ">>> " in _doc(node)]


def _run(name: str, names: dict) -> dict:
    """Run the example of a name among `names`, and return what it has defined."""
    test = doctest.DocTestParser().get_doctest(
        _doc(DOCUMENTED[name]), names, name, None, 0
    )
    shown = io.StringIO()
    done = doctest.DocTestRunner(verbose=False).run(
        test, out=shown.write, clear_globs=False
    )
    assert done.attempted and not done.failed, shown.getvalue()
    return test.globs


def _given(name: str) -> dict:
    """What an example may use: also what the one that it continues has defined."""
    told = r"example\s+continues\s+the\s+one\s+in\s+\[`([\w.]+)`\]"
    continued = re.search(told, _doc(DOCUMENTED[name]))
    return {**GIVEN, **(_defined_by(continued[1]) if continued else {})}


@functools.cache
def _defined_by(name: str) -> dict:
    return _run(name, _given(name))


@pytest.mark.parametrize(
    "name",
    [
        name if name.startswith(QUICK) else pytest.param(name, marks=pytest.mark.slow)
        for name in EXAMPLES
    ],
)
def test_an_example_prints_what_is_shown(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _run(name, _given(name))
    plt.close("all")
