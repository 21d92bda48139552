"""The commands, as a reader types them."""

import json
import math
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import typer
from typer.main import get_command
from typer.testing import CliRunner

import jaxcam as package
from jaxcam import _xla_log, discrepancy
from jaxcam.cli import app
from jaxcam.cli._cache import keep_compiled_programs
from jaxcam.cli._case import SIMULATED
from jaxcam.cli._errors import one_sentence
from jaxcam.cli._output import to_text
from jaxcam.cli._parameters import assign_parameters, parameters
from jaxcam.cli._source import make_system
from jaxcam.data import DEMO_RIG, PENDULUM
from jaxcam.recordings import RecordingError


BALL = "simulate bouncing-ball --set restitution=0.5 --state 2,0 --t1 3".split()


def jaxcam(*arguments, ok=True):
    found = CliRunner().invoke(app, [str(a) for a in arguments])
    if ok:
        assert found.exit_code == 0, found.output
    return found


def refused(*arguments) -> str:
    """The one sentence of a command that cannot be carried out."""
    found = jaxcam(*arguments, ok=False)
    assert found.exit_code == 2, found.output
    assert found.stdout == ""
    assert isinstance(found.exception, SystemExit)
    (line,) = found.stderr.splitlines()
    assert line.endswith(".") and line[:1].strip()
    return line


def examples():
    """Every line that a help shows, as it is pasted: each fits into the window."""
    for name in (None, *get_command(app).commands):  # pyright: ignore
        arguments = ["--help"] if name is None else [name, "--help"]
        text = jaxcam(*arguments).stdout
        found = re.findall(r"^\s+(jaxcam [a-z]+ ?.*?)\s*$", text, re.MULTILINE)
        assert found, name
        yield from found


def test_version():
    assert jaxcam("--version").stdout == f"jaxcam {package.__version__}\n"


@pytest.mark.parametrize("module", ["jaxcam", "jaxcam.cli"])
def test_python_runs_the_command_as_a_module(module):
    line = [sys.executable, "-m", module, "--version"]
    found = subprocess.run(line, capture_output=True, text=True, check=True)
    assert found.stdout.startswith("jaxcam ")


def test_examples_in_the_help_name_options_that_exist():
    commands = get_command(app).commands  # pyright: ignore
    for line in examples():
        assert not line.endswith("\\"), line
        _, name, *arguments = shlex.split(line)
        context = commands[name].make_context(name, arguments)
        assert context.params


def test_the_shipped_recordings_have_a_name(tmp_path, monkeypatch):
    """A folder of the user's that has the same name is the user's."""
    monkeypatch.chdir(tmp_path)
    for command in ("fit", "diagnose"):
        made = get_command(app).commands[command]  # pyright: ignore
        for word, folder in (("demo", DEMO_RIG), ("pendulum", PENDULUM)):
            assert made.make_context(command, [word]).params["case"] == folder
        other = made.make_context(command, ["./runs"]).params["case"]
        assert other == Path("runs")
    (tmp_path / "demo").mkdir()
    assert made.make_context("fit", ["demo"]).params["case"] == Path("demo")


def test_ball_as_in_closed_form(tmp_path):
    file = tmp_path / "new" / "ball.json"
    shown = jaxcam(*BALL, "--json", file).stdout
    found = json.loads(file.read_text())
    fall, r = math.sqrt(2 * 2.0 / 9.81), 0.5
    number = found["impacts"]["count"]
    k = np.arange(number)
    # a rebound of speed r^k v lasts 2 r^k of the first fall
    times = fall * (1 + 2 * np.cumsum(np.append(0.0, r ** k[1:])))
    speeds = 9.81 * fall * r**k
    assert number > 10
    np.testing.assert_allclose(found["impacts"]["time"], times, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found["impacts"]["speed_before"], -speeds, rtol=1e-7)
    (start,), (end,) = found["contacts"]["start"], found["contacts"]["end"]
    assert start == pytest.approx(fall * (1 + r) / (1 - r), abs=1e-9)
    assert end == 3.0 and found["contacts"]["released"] == [False]
    assert found["parameters"]["restitution"] == 0.5
    assert found["successful"] and found["result"] == ""
    assert f"{times[0]:.8f}" in shown and found["sentence"].split(";")[0][:30] in shown


def test_nothing_but_json_on_standard_output():
    found = jaxcam(*BALL, "--json", "-")
    assert json.loads(found.stdout)["system"] == "bouncing-ball"


def test_figures_are_written(tmp_path):
    jaxcam(*BALL, "--out", tmp_path / "figures")
    names = {file.name for file in (tmp_path / "figures").iterdir()}
    assert names == {"time_history.png", "phase_portrait.png", "impact_map.png"}


def test_run_that_stops_early_says_so(monkeypatch):
    real = package.simulate

    def stopped(*args, **kwargs):
        code = jnp.asarray(1, dtype=jnp.int32)
        return eqx.tree_at(lambda t: t.code, real(*args, **kwargs), code)

    monkeypatch.setattr(package, "simulate", stopped)
    found = jaxcam(*BALL, ok=False)
    assert found.exit_code == 1
    assert "stopped early" in found.stdout and "raise max_steps" in found.stderr


def test_interrupted_run_says_so(monkeypatch):
    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(package, "simulate", interrupted)
    found = jaxcam(*BALL, ok=False)
    assert found.exit_code == 130
    assert (
        found.stderr
        == "Stopped by Ctrl-C before the end; run the command again to finish.\n"
    )


@pytest.mark.parametrize(
    ("out", "resume", "words"),
    [
        (None, False, "run the command again to finish."),
        (Path("DIR"), False, "add --resume to continue from the stored results."),
        (Path("DIR"), True, "run it again to continue from the stored results."),
    ],
)
def test_interrupted_command_says_how_to_go_on(out, resume, words, capsys):
    @one_sentence
    def command(*, out, resume):
        raise KeyboardInterrupt

    with pytest.raises(typer.Exit):
        command(out=out, resume=resume)
    assert capsys.readouterr().err.endswith(words + "\n")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("simulate pendulum", "cam-follower, impact-oscillator"),
        ("simulate --preset table-9", '"table-4.4"'),
        ("simulate bouncing-ball --preset table-4.4", "--set"),
        ("simulate bouncing-ball --speed 140", "leave it out"),
        ("simulate --speed 0", "positive"),
        ("simulate --speed nan", "positive"),
        ("simulate --set speed=15", "--speed"),
        ("simulate --set profile.size=1", "profile.radius"),
        ("simulate --set profile.radius", "name and a value"),
        ("simulate --set profile.radius=big", "finite number"),
        ("simulate --set inertia=inf", "finite number"),
        ("simulate --set restitution.r=1.5", "between 0 and 1"),
        ("simulate bouncing-ball --set restitution=-0.1", "between 0 and 1"),
        ("simulate --set profile.radius=0.4", "make it smaller"),
        ("simulate --state low", "commas"),
        ("simulate --state nan,0", "finite"),
        ("simulate --state 0.3", "follower velocity"),
        ("simulate --state 0.1,0", "--state release"),
        ("simulate impact-oscillator --set wall=2", "--state"),
        ("simulate triple-integrator --state release", "at the release point needs"),
        ("simulate --t1 -1", "before t0"),
        ("simulate --t0 nan", "finite"),
        ("simulate --t1 3 --turns 3", "not both"),
        ("simulate --turns 0", "positive"),
        ("simulate triple-integrator --turns 3", "--t1"),
        ("simulate --tolerance 0", "1e-10"),
        ("simulate --tolerance -1e-9", "1e-10"),
        ("simulate --solver euler", "dopri8, tsit5"),
        ("simulate --engine fast", "loop, diffeqsolve"),
        ("simulate --solver kvaerno5 --engine loop", "--engine diffeqsolve"),
        ("simulate --out FILE", "folder"),
        ("simulate --out FILE/below", "folder"),
        ("simulate --json FOLDER", "file"),
        ("simulate --json FILE/below", "folder"),
        ("demo --case FOLDER/nowhere", "no such folder"),
        ("demo --case FOLDER", "no recording"),
        ("demo --case EMPTY --rig RIG", "empty"),
        ("demo --case CUT --rig RIG", "truncated"),
        ("demo --case DEGREES --rig RIG", "degrees"),
        ("demo --case GAPS --rig RIG", "--gaps split"),
        ("demo --case WHOLE", "--rig"),
        ("demo --rig FOLDER/nowhere", "does not exist"),
        ("demo --rig FILE", "TOML"),
        ("demo --out FILE", "folder"),
        ("demo --gaps ignore", "refuse, split"),
    ],
)
def test_bad_input_is_one_sentence(line, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(package, "simulate", _checked_only(package.simulate))
    places = {"RIG": DEMO_RIG / "rig.toml", "FILE": tmp_path / "file"}
    places["FILE"].write_text("not = [ a table")
    header, rows = "time_s,cam_angle_rad,follower_angle_rad", _rows(0.3)
    for name, text in (
        ("FOLDER", None),
        ("EMPTY", ""),
        ("CUT", "\n".join([header, *rows[:500], "0.3,4"])),
        ("DEGREES", "\n".join([header, *_rows(17.0)])),
        ("WHOLE", "\n".join([header, *rows, ""])),
        ("GAPS", "\n".join([header, *rows[:500], *rows[600:], ""])),
    ):
        places[name] = tmp_path / name
        places[name].mkdir()
        if text is not None:
            (places[name] / "run1_140rpm.csv").write_text(text)
    arguments = []
    for word in line.split():
        head, slash, rest = word.partition("/")
        arguments.append(f"{places[head]}{slash}{rest}" if head in places else word)
    before = sorted(tmp_path.iterdir())
    assert words in refused(*arguments)
    assert sorted(tmp_path.iterdir()) == before


def _rows(level):
    speed = 140 * math.pi / 30
    return [
        f"{k / 2000:.4f},{speed * k / 2000:.6f},{level + 0.01 * math.sin(k):.6f}"
        for k in range(1500)
    ]


def _checked_only(simulate):
    """A simulation that must not be reached, but for its checks."""

    def wrapper(*args, **kwargs):
        simulate(*args, **kwargs)
        raise AssertionError("bad input was accepted")

    return wrapper


def test_unknown_option_is_refused():
    assert jaxcam("simulate", "--nosuch", ok=False).exit_code == 2


def test_parameters_by_name():
    system = make_system("cam-follower", "table-4.4", 120.0)
    assert float(system.speed) == pytest.approx(4 * math.pi)  # pyright: ignore
    changed = assign_parameters(
        system, ["profile.radius=0.04", "restitution.slope=0.01"]
    )
    values = parameters(changed)
    assert values["profile.radius"] == 0.04
    assert values["restitution.slope"] == 0.01
    assert values["profile.eccentricity"] == 0.015
    constant = assign_parameters(system, ["restitution.r=0.6", "restitution.r=0.7"])
    assert parameters(constant)["restitution.r"] == 0.7
    assert "restitution.slope" not in parameters(constant)


def test_json_has_no_numbers_that_json_has_not():
    found = {"a": jnp.array([1.0, jnp.inf]), "b": (math.nan, np.float64(2)), "c": None}
    text = to_text(found)
    assert json.loads(text) == {"a": [1.0, None], "b": [None, 2.0], "c": None}


def test_compiled_programs_are_kept_where_the_user_says(tmp_path, monkeypatch):
    name = "jax_compilation_cache_dir"
    before = getattr(jax.config, name)
    try:
        keep_compiled_programs()
        assert getattr(jax.config, name) == before
        monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR")
        monkeypatch.setattr("sys.platform", "linux")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        keep_compiled_programs()
        assert getattr(jax.config, name) == str(tmp_path / "jaxcam" / "compiled")
    finally:
        jax.config.update(name, before)


@pytest.fixture(scope="module")
def demonstration(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "report"
    found = jaxcam(
        "demo", "--no-diagnose", "--out", folder, "--json", folder / "again.json"
    )
    return folder, found.stdout


@pytest.mark.slow
def test_demo_compares_the_shipped_recording(demonstration):
    folder, shown = demonstration
    found = json.loads((folder / "result.json").read_text())
    assert found == json.loads((folder / "again.json").read_text())
    assert len(found["runs"]) == 3
    modes = {row["mode"] for row in found["comparison"]["rows"]}
    assert modes == {"flight", "contact", "impact position", "impact speed"}
    for mode in modes:
        assert mode in shown
    assert "are simulated." in shown and "rad rms" in shown
    # the nominal rig is close to the recorded one, and rests in the same places
    slowest = found["runs"][0]["rests"]
    assert slowest["recorded"]["per_turn"] > 0.7
    assert slowest["simulated"]["per_turn"] > 0.9
    for end in ("from", "to"):
        recorded, simulated = (
            np.median(slowest[which][end]) for which in ("recorded", "simulated")
        )
        assert recorded == pytest.approx(simulated, abs=0.3)


@pytest.mark.slow
def test_page_of_the_demo_holds_everything_itself(demonstration):
    folder, _ = demonstration
    page = (folder / "index.html").read_text(encoding="utf-8")
    figures = sorted(file.name for file in folder.glob("*.png"))
    assert sum(name.startswith("recording_") for name in figures) == 3
    assert {"residual_by_mode_time.png", "residual_by_mode_phase.png"} < set(figures)
    sources = re.findall(r'src="([^"]{0,30})', page)
    assert len(sources) == len(figures)
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert not re.search(r"https?://|<link|<script|@import|url\(", page)
    assert 'name="viewport"' in page and "prefers-color-scheme: dark" in page
    # the sentence, then the table, then the figures, then what to type next
    order = ("In flight", "Residuals by mode", "<h2>Figures", "<pre>")
    places = [page.index(text) for text in order]
    assert places == sorted(places)


@pytest.mark.slow
def test_commands_on_the_page_of_the_demo_can_be_pasted(demonstration):
    folder, _ = demonstration
    page = (folder / "index.html").read_text(encoding="utf-8")
    commands = get_command(app).commands  # pyright: ignore
    shown = re.findall(r"<pre>(.*?)</pre>", page)
    lines = [re.sub("<.*?>", "", line).removeprefix("jaxcam ") for line in shown]
    # on to a system and a recording of one's own
    named = {line.split()[0] for line in lines}
    assert named == {"simulate", "continue", "new-rig", "diagnose", "demo"}
    for line in lines:
        name, *arguments = shlex.split(line)
        assert commands[name].make_context(name, arguments).params


def test_a_verdict_is_kept_if_no_recording_can_be_recommended(tmp_path, monkeypatch):
    """The sentence stands in the error, with exit code 2; the verdict is written."""

    def fails(*arguments):
        raise RecordingError("No flight occurs; give a higher speed.")

    fitted = SimpleNamespace(problem=SimpleNamespace(segments=()))
    found = SimpleNamespace(to_json=lambda: {"verdict": "none"}, after=fitted)
    monkeypatch.setattr(discrepancy, "diagnose", lambda *words, **options: found)
    # the package exports the command under the name of its module
    module = sys.modules["jaxcam.cli._diagnose"]
    monkeypatch.setattr(module, "_outlook", fails)
    monkeypatch.setattr(module, "_print", lambda *words: None)
    file = tmp_path / "verdict.json"
    line = ["diagnose", "demo", "--next", f"--json={file}"]
    said = CliRunner().invoke(app, line)
    assert said.exit_code == 2 and "No flight occurs" in said.output
    # notes on the recordings are kept too
    written = json.loads(file.read_text())
    assert written == {"verdict": "none", "notes": [SIMULATED]}


@pytest.mark.parametrize(
    ("words", "interpreter", "level"),
    [
        (["/usr/bin/jaxcam", "fit"], ["python", "/usr/bin/jaxcam", "fit"], "3"),
        (["jaxcam.exe"], ["jaxcam.exe"], "3"),
        (["-m", "fit"], ["python", "-X", "dev", "-m", "jaxcam", "fit"], "3"),
        (["-m"], ["python", "-m", "jaxcam.cli"], "3"),
        (["-m"], ["python", "-m", "pytest"], None),
        (["study.py"], ["python", "study.py"], None),
    ],
)
def test_only_the_command_line_silences_the_compiler(
    words, interpreter, level, monkeypatch
):
    monkeypatch.setattr(_xla_log.sys, "argv", words)
    monkeypatch.setattr(_xla_log.sys, "orig_argv", interpreter)
    monkeypatch.delenv("TF_CPP_MIN_LOG_LEVEL", raising=False)
    _xla_log.silence_xla()
    assert os.environ.get("TF_CPP_MIN_LOG_LEVEL") == level
    monkeypatch.setenv("TF_CPP_MIN_LOG_LEVEL", "0")
    _xla_log.silence_xla()
    assert os.environ["TF_CPP_MIN_LOG_LEVEL"] == "0"
