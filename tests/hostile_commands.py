"""Command lines that nobody meant to type, run until the computing would begin."""

import contextlib
import functools
import shutil
import typing
import warnings
from pathlib import Path
from unittest import mock

import hostile_files
from hypothesis import strategies as st
from typer.main import get_command
from typer.testing import CliRunner

import continuation.orbits._periodic  # noqa: F401  what is patched below
import jaxcam.discrepancy
import jaxcam.fitting
import jaxcam.recordings
import jaxcam.sweeps  # noqa: F401  what is patched below
from jaxcam.cli import app
from jaxcam.cli._choices import ENGINES, SOLVERS, SYSTEMS
from jaxcam.data import DEMO_RIG, NEW_RIG
from jaxcam.thesis import TARGETS


class Reached(BaseException):
    """The input was accepted: from here on it would be computed."""


#: what is computed first by each command, behind all of its checks
FIRST_WORK = (
    "jaxcam.hybrid._untraced._begin",
    "jaxcam.hybrid._simulate.simulate_segments",
    "jaxcam.sweeps.blocks._run._drive",
    "jaxcam.sweeps.cluster",
    "continuation.orbits._periodic.periodic_orbit",
    "jaxcam.fitting.Problem.build",
    "jaxcam.fitting._setup.segment_by_model",
    "jaxcam.recordings.against_model.compare_case",
    "jaxcam.cli._reproduce_record.reproduce",
)


# --- the files that a line may name


@functools.cache
def _torn_system() -> str:
    return hostile_files.system("rig").replace("0.2", "0,2", 1)


def places(folder: Path) -> None:
    """Make the files and folders that lines name, afresh where they were changed."""
    for name in ("empty", "out", "result.json"):
        shutil.rmtree(folder / name, ignore_errors=True)
    (folder / "empty").mkdir()
    (folder / "file").write_text("not = [ a table")
    (folder / "rubbish").write_bytes(bytes(range(256)) * 8)
    (folder / "ball.json").write_text(hostile_files.system("ball"))
    (folder / "rig.json").write_text(hostile_files.system("rig"))
    (folder / "torn.json").write_text(_torn_system())
    (folder / "result.json").unlink(missing_ok=True)
    for name in ("cart.py", "cart.toml"):
        shutil.copy(NEW_RIG / name, folder)
    (folder / "torn.toml").write_text((folder / "cart.toml").read_text()[:700])
    if not (folder / "case").exists():
        shutil.copytree(DEMO_RIG, folder / "case")
        (folder / "cut").mkdir()
        text = hostile_files.table()
        (folder / "cut" / "run1_150rpm.csv").write_text(text[:-9])
        shutil.copy(DEMO_RIG / "rig.toml", folder / "cut")
        (folder / "short").mkdir()
        for k in (1, 2):
            (folder / "short" / f"run{k}_150rpm.csv").write_text(text)
        shutil.copy(DEMO_RIG / "rig.toml", folder / "short")
        (folder / "carts").mkdir()
        text = text.replace("follower_angle_rad", "position_m")
        for k in (1, 2):
            (folder / "carts" / f"run{k}.csv").write_text(text)
        shutil.copy(NEW_RIG / "cart.toml", folder / "carts" / "rig.toml")


PATHS = st.sampled_from(
    "empty file file/below rubbish ball.json rig.json torn.json case case/rig.toml cut "
    "short carts cart.py cart.toml torn.toml cart.py:Cart cart.py:Card cart.toml:Cart "
    "nowhere nowhere/x.json . .. / /dev/null /proc/nowhere".split()
    + ["", "x" * 300, "a\nb", "a\x1b[31mb", "~", "*"]
)
#: what is written; never outside of the folder
TARGET_PATHS = st.sampled_from(
    [
        "out",
        "out",
        "out/deep/er",
        "file",
        "file/below",
        "/proc/nowhere/x",
        "/dev/null/x",
    ]
    + ["x" * 300, "out/a\x1b[31mb", "-", "result.json", "out/r.json"]
)


# --- values of options


_FLOATS = st.sampled_from(
    "0 -1 1 3 0.3 1e-10 140 145 nan inf -inf 1e308 -1e308 1e-320 1e-300 abc".split()
    + ["", "1_0", "0x10", "9" * 400, "1e400", "١"]
) | st.floats().map(repr)
_INTEGERS = st.sampled_from(
    "0 1 2 3 24 100 -1 1e3 2.5 nan x 1000000 100000000 10000000000".split()
    + ["", "9" * 30, "9" * 5000]
) | st.integers(-5, 300).map(str)
_STATES = st.sampled_from(
    "0.4,1.8 0.37,1.8 0.3,0 -1,0 -0.5,1 1,0 2,0 0,0.1,-2 release 0.1,0 nan,0".split()
    + ["", ",", "0.3", "0.3,0,0,0", "1e308,1e308", "0.4,1e300", "a,b", "0.4;1", "0.4,"]
    + ["128,128", "0,0", "2.5,3", "-3,4", "1e9,1e9", "100000,100000", "9" * 400 + ",1"]
)
_SETTINGS = st.tuples(
    st.sampled_from(
        "restitution.r restitution omega wall gravity profile.radius inertia stiffness"
        " speed profile.eccentricity nothing profile terms[0].c1 __class__".split()
        + ["", "a.b.c", "[0]"]
    ),
    st.sampled_from(["=", "=", "=", "", "==", ":"]),
    _FLOATS,
).map("".join)
_NAMES = {
    "--preset": ["table-4.4", "calibrated", "table-9", ""],
    "--parameter": ["speed", "omega", "wall", "profile.eccentricity", "nothing"],
    "--section": ["stroboscope", "impacts", "poincare"],
    "--direction": ["each", "up", "down", "both", "left", ""],
    "--algorithm": ["pseudo-arclength", "moore-penrose", "natural", "guess"],
    "--engine": [*ENGINES, "fast"],
    "--solver": [*SOLVERS, "euler"],
    "--gaps": ["refuse", "split", "mend", "ignore"],
    "--size": ["default", "full", "huge"],
    "--cluster": ["local", "tcp://127.0.0.1:1", "here", ""],
    "SYSTEM": [*SYSTEMS, *SYSTEMS, "pendulum", ""],
    "TARGET": [*sorted(TARGETS)[:3], "all", "table-0"],
}  # fmt: skip
_STATED = ("--state", "--low", "--high", "--shape")
_WRITTEN = ("--out", "--json", "NAME")


def _value(name: str, kind: object) -> st.SearchStrategy[str]:
    """Values of an option of a type, good and bad."""
    word = hostile_files.WORDS.filter(lambda w: not w.startswith("-"))
    if name in _WRITTEN:
        return TARGET_PATHS
    if name == "--set":
        return _SETTINGS
    if name in _STATED:
        return _STATES | _STATES | word
    if name in _NAMES:
        return st.sampled_from(_NAMES[name]) | st.sampled_from(_NAMES[name]) | word
    kinds = typing.get_args(kind) or (kind,)
    if float in kinds:
        return _FLOATS
    return _INTEGERS if int in kinds else PATHS


#: lines that are right, to which others are near
_RIGHT = {
    "simulate": [
        [],
        ["--speed=140"],
        ["bouncing-ball", "--t1=3"],
        ["--rig=cart.toml", "--state=0,1", "--t1=1"],
    ],
    "diagram": [["--from=150", "--to=154"], ["--from=150"]],
    "basins": [[], ["--speed=150"], ["impact-oscillator", "--shape=9,9"]],
    "continue": [["--from=130", "--to=160", "--at=145"], ["--from=130", "--to=160"]],
    "demo": [[], ["--no-diagnose"], ["--case=case"], ["--case=short"]],
    "diagnose": [["case"], ["short"], ["cut"], ["carts", "--rig=cart.toml"], []],
    "fit": [["case"], ["short"], ["empty"], ["carts", "--rig=cart.toml"]],
    "new-rig": [["cart"], ["other"], []],
    "reproduce": [["table-5.2"], ["--list"], []],
}  # fmt: skip


@functools.cache
def _options(name: str) -> tuple[tuple[typing.Any, object], ...]:
    """Each parameter of a command, and its type."""
    command = get_command(app).commands[name]  # pyright: ignore
    (callback,) = (
        known.callback
        for known in app.registered_commands
        if (known.name or known.callback.__name__) == name  # pyright: ignore
    )
    kinds = typing.get_type_hints(callback)
    return tuple((p, kinds[p.name]) for p in command.params if p.name in kinds)


@st.composite
def lines(draw, names=tuple(_RIGHT)) -> list[str]:
    """A command and its arguments: a right line with some options more."""
    name = draw(st.sampled_from(names))
    line = [name, *draw(st.sampled_from(_RIGHT[name]))]
    for parameter, kind in draw(st.lists(st.sampled_from(_options(name)), max_size=4)):
        option = parameter.opts[-1]
        if not option.startswith("-"):
            word = draw(_value(str(parameter.metavar).strip("[]"), kind))
            line.insert(1, word)
        elif kind is bool:
            both = [*parameter.opts, *parameter.secondary_opts]
            line.append(draw(st.sampled_from(both)))
        else:
            line.append(f"{option}={draw(_value(option, kind))}")
    if name == "demo" and not any(part.startswith("--out") for part in line):
        line.append("--out=out")
    return line


# --- running them


@contextlib.contextmanager
def _no_process(work, folder):
    """The branches of the demo are computed elsewhere, and not here."""
    del work, folder
    yield lambda: None


def run_or_say(folder: Path, line: list[str]) -> str:
    """Run a line up to its first work; say how it ended.

    The line ends well, is accepted, or is refused with exit code 2 and one sentence on
    the error stream.
    """
    with contextlib.chdir(folder), contextlib.ExitStack() as stack:
        places(folder)
        for work in FIRST_WORK:
            stack.enter_context(mock.patch(work, side_effect=Reached))
        stack.enter_context(mock.patch("jaxcam.cli._beside.beside", _no_process))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("error")
        try:
            found = CliRunner().invoke(app, line)
        except Reached:
            return "accepted"
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    assert found.exit_code in (0, 2), (line, found.exit_code, found.output)
    if found.exit_code == 0:
        return "done"
    if found.stderr.startswith("Usage:"):
        return "refused by its form"
    (sentence,) = found.stderr.splitlines()
    hostile_files.said(ValueError(sentence))
    return "refused"
