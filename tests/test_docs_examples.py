"""What the documentation shows is run, not believed.

Every Python block of every page runs, in the order of the page; where a block of text
follows it, that is what it prints. Pages that take longer than about ten seconds are
marked slow. Of the commands it is checked that they and their options exist.
"""

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from jaxcam.data import DEMO_RIG


ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"

#: pages whose blocks take longer than ten seconds
SLOW = {
    "chatter.md",
    "continuation.md",
    "discrepancy.md",
    "filippov.md",
    "fitting.md",
    "impacting_orbits.md",
    "own_recording.md",
    "real_recording.md",
    "sweeps.md",
    "tour.md",
    "variational.md",
}

#: blocks that take more than ten minutes, by a word in them: compiled, not run
TOO_LONG = {"event_causes("}


def text_of(page: str) -> str:
    """A page with the files that it includes."""
    text = (DOCS / page).read_text("utf-8")

    def included(found: re.Match) -> str:
        name, _, section = found[1].partition(":")
        whole = (ROOT / name).read_text("utf-8")
        if not section:
            return whole
        mark = r"<!-- --8<-- \[{}:{}\] -->\n"
        start = re.search(mark.format("start", section), whole)
        end = re.search(mark.format("end", section), whole)
        assert start and end, f"{page} includes {found[1]}"
        return whole[start.end() : end.start()]

    return re.sub(r'^--8<-- "(.*)"$', included, text, flags=re.MULTILINE)


def blocks(page: str) -> list[tuple[str, str | None]]:
    """Code blocks in their order, each with the output shown right below it."""
    pattern = r"^```python\n(.*?)^```$(?:\n\n(?:It prints:\n\n)?^```text\n(.*?)^```$)?"
    return re.findall(pattern, text_of(page), re.DOTALL | re.MULTILINE)


PAGES = sorted(
    str(file.relative_to(DOCS))
    for file in DOCS.rglob("*.md")
    if "```python" in text_of(str(file.relative_to(DOCS)))
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files that the pages speak of."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _cart_case(folder: Path) -> None:
    """The files of the tutorial on a recording of one's own, without its friction."""
    import runpy

    from jaxcam.data import NEW_RIG

    for name in ("cart.py", "cart.toml"):
        shutil.copy(NEW_RIG / name, folder)
    code = blocks("own_recording.md")[0][0]
    (folder / "make_case.py").write_text(code, "utf-8")
    runpy.run_path(str(folder / "make_case.py"))


def _demo_case(folder: Path) -> None:
    """The shipped case and its rig file, under the names that the pages give them."""
    shutil.copytree(DEMO_RIG, folder / "case")
    shutil.copy(DEMO_RIG / "rig.toml", folder)


def _falling_ball(folder: Path) -> None:
    """A ball that bounces, in a file."""
    time = np.arange(0.0, 1.2, 1e-3)
    height, velocity = np.zeros_like(time), 0.0
    height[0] = 1.0
    for k in range(1, len(time)):
        velocity -= 9.81e-3
        height[k] = height[k - 1] + 1e-3 * velocity
        if height[k] < 0:
            height[k], velocity = -0.8 * height[k], -0.8 * velocity
    noise = np.random.default_rng(0).normal(0.0, 1e-3, len(time))
    rows = np.column_stack([time, height + noise])
    np.savetxt(
        folder / "drop.csv", rows, "%.6f", ",", header="time_s,height_m", comments=""
    )


def _impacts(folder: Path) -> None:
    """Speeds before and after twenty impacts, in a file."""
    rng = np.random.default_rng(0)
    before = rng.uniform(0.2, 2.0, 20)
    after = 0.7 * before + rng.normal(0.0, 0.005, 20)
    rows = np.column_stack([before, after])
    np.savetxt(
        folder / "impacts.csv",
        rows,
        "%.6f",
        ",",
        header="before_m_s,after_m_s",
        comments="",
    )


def _basins(folder: Path) -> None:
    """A small sweep in the folder that the page reads."""
    _command("jaxcam basins --preset calibrated --speed 145 --turns 24 "
             "--shape 8,8 --out ./basins")  # fmt: skip


def _command(line: str) -> None:
    """Run a command of the package in this process."""
    from jaxcam.cli import main

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", shlex.split(line))
        with pytest.raises(SystemExit) as ended:
            main()
    assert ended.value.code in (0, None), line


FILES = {
    "discrepancy.md": [_demo_case],
    "fitting.md": [_cart_case, _falling_ball],
    "own_recording.md": [],
    "recordings.md": [_impacts],
    "sweeps.md": [_basins],
}


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=[pytest.mark.slow] if p in SLOW else []) for p in PAGES],
)
def test_examples_run_and_print_what_is_shown(page, folder, capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(folder))
    if page == "own_recording.md":
        _command("jaxcam new-rig cart")
    for make in FILES.get(page, ()):
        make(folder)
    capsys.readouterr()
    names = {"__name__": "docs"}
    for number, (code, shown) in enumerate(blocks(page), start=1):
        compiled = compile(code, f"{page}, block {number}", "exec")
        if any(word in code for word in TOO_LONG):
            continue
        exec(compiled, names)
        printed = capsys.readouterr().out
        if shown:
            assert printed == shown, f"{page}, block {number}"


def command_lines() -> list[tuple[str, str]]:
    """Page and command for every line of a console block that calls `jaxcam`."""
    found = []
    for file in sorted(DOCS.rglob("*.md")):
        page = str(file.relative_to(DOCS))
        text = text_of(page)
        for block in re.findall(r"^```console\n(.*?)^```$", text, re.DOTALL | re.M):
            lines = block.replace("\\\n", " ").splitlines()
            found += [(page, line.strip()) for line in lines if "jaxcam " in line]
    return found


@pytest.mark.parametrize("page, line", command_lines())
def test_commands_and_their_options_exist(page, line):
    import typer

    from jaxcam.cli._app import app

    _, *words = shlex.split(line[line.index("jaxcam ") :], comments=True)
    words = words[: words.index("&&")] if "&&" in words else words
    command = typer.main.get_command(app)
    with command.make_context("jaxcam", words, resilient_parsing=True) as context:
        name, chosen, rest = command.resolve_command(context, words)
        # raises for an option that there is not, or one without its value
        chosen.make_parser(context).parse_args(rest)
    assert name == words[0], page
