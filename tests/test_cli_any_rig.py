"""A user's own system from the command line: an example, recordings, a report."""

import json
import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import hostile_files
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

from jaxcam.cli import _fit_result, app
from jaxcam.cli._axis import Axis
from jaxcam.cli._output import Output
from jaxcam.cli._source import Source
from jaxcam.data import DEMO_RIG
from jaxcam.fitting import Input, Model, Parameter, Turning
from jaxcam.fitting._doubts import Doubt, Reason
from jaxcam.fitting._fit_result import Estimate
from jaxcam.models import preset


ROOT = Path(__file__).parents[1]
TRUTH = {
    "stiffness": 41.5,
    "damping": 0.25,
    "left": -0.0502,
    "right": 0.0603,
    "restitution_left": 0.74,
    "restitution_right": 0.66,
}
# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """The example that new-rig writes, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    run("new-rig", "cart")
    return tmp_path


def run(*words):
    found = CliRunner().invoke(app, list(words))
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    assert found.exit_code == 0, found.output
    return found.output


def refusal(*words):
    found = CliRunner().invoke(app, list(words))
    if found.exception is not None and not isinstance(found.exception, SystemExit):
        raise found.exception
    assert found.exit_code == 2, found.output
    (sentence,) = found.stderr.splitlines()
    hostile_files.said(ValueError(sentence))
    return sentence


def released(velocity: float, rng, duration=1.2) -> np.ndarray:
    """Times (s) and positions (mm) of a cart of `TRUTH`, flight by flight."""
    stops = np.array([TRUTH["left"], TRUTH["right"]])
    r = np.array([TRUTH["restitution_left"], TRUTH["restitution_right"]])

    def field(t, y):
        return [y[1], -TRUTH["stiffness"] * y[0] - TRUTH["damping"] * y[1]]

    events = [lambda t, y: y[0] - stops[0], lambda t, y: stops[1] - y[0]]
    for event in events:
        event.terminal, event.direction = True, -1  # pyright: ignore
    time = 5e-4 * np.arange(round(duration / 5e-4))
    x, t, y = np.zeros(len(time)), 0.0, np.array([0.0, velocity])
    while t < time[-1]:
        span = (t, time[-1])
        part = solve_ivp(
            field, span, y, "DOP853", None, True, events, rtol=1e-11, atol=1e-13
        )
        inside = (time >= t) & (time <= part.t[-1])
        x[inside] = part.sol(time[inside])[0]  # pyright: ignore
        t = part.t[-1]
        if part.status == 1:
            side = int(len(part.t_events[1]) > 0)  # pyright: ignore
            y = np.array([stops[side], -r[side] * part.y[1, -1]])
    noisy = np.round((x + 1e-5 * rng.standard_normal(len(x))) / 5e-6) * 5e-6
    return np.stack([time, 1e3 * noisy], axis=1)


def write_case(folder: Path) -> None:
    folder.mkdir()
    rng = np.random.default_rng(0)
    for number, velocity in enumerate((1.2, -1.4, 1.6, -1.0), start=1):
        np.savetxt(
            folder / f"run{number}.csv",
            released(velocity, rng),
            delimiter=",",
            header="time_s,position_mm",
            comments="",
        )


@pytest.mark.parametrize("converged", [True, False])
def test_the_reason_of_a_failed_fit_is_left_to_standard_error(
    converged, capsys, monkeypatch
):
    for name in ("parameter_table", "correlation_table"):
        monkeypatch.setattr(_fit_result, name, lambda *fit: "table")
    after = SimpleNamespace(
        converged=converged,
        message="Reason.",
        most_correlated=lambda: "a and b",
        estimates=("a", "b"),
    )
    found = SimpleNamespace(
        problem=None,
        after=after,
        again=None,
        seen=SimpleNamespace(sentences=lambda: []),
        events="",
        doubted="The unit is in doubt.",
        laws={},
        remainder="Remainder.",
        outside=[],
        sentence="Reason. Remainder.",
    )
    _fit_result.print_fit(Output(None, None), found, ())  # pyright: ignore
    said = capsys.readouterr().out
    assert said.count("Reason.") == converged
    assert said.startswith("The unit is in doubt.")


def _ended(gravity: float, ratio: float, reasons=()):
    """A fit with one parameter (9.81 +- 0.02) and one channel."""
    parameter = Parameter("gravity", lambda model: model, 0.02, nominal=9.81)
    problem = SimpleNamespace(
        names=("gravity",),
        parameters=(parameter,),
        start=SimpleNamespace(values=np.array([[9.81], [9.81]])),
        parameter=lambda name: parameter,
        samples=9,
        records=("a", "b"),
        model=SimpleNamespace(drive=None),
    )
    estimate = Estimate("gravity", gravity, 0.001, "m/s^2")
    after = SimpleNamespace(estimates=[estimate], reasons=reasons)
    found = _fit_result.Result(problem, (), None, after, None, {}, None)  # pyright: ignore
    part = {"record": "a", "channel": "x", "rms": ratio, "noise": 1.0, "ratio": ratio}
    return found, part


@pytest.mark.parametrize(
    ("gravity", "count"), [(9.973, 1), (9.647, 1), (9.8325, 0), (9.834, 1)]
)
def test_a_value_outside_its_tolerance_is_said(gravity, count):
    """By more than 3 standard errors (of 0.001) beyond 9.79 or 9.83."""
    sentences = _ended(gravity, 1.0)[0].outside
    assert len(sentences) == count
    for sentence in sentences:
        assert "outside its tolerance (9.79 to 9.83 m/s^2)" in sentence


AT_BOUND = (Reason(Doubt.ON_A_BOUND, "It is at its lower bound."),)


@pytest.mark.parametrize(
    ("gravity", "ratio", "reasons", "said"),
    [
        (9.81, 999.0, (), False),
        (9.81, 1001.0, (), True),
        # ten tolerances of 0.02
        (9.81 + 0.199, 1.0, (), False),
        (9.81 - 0.201, 1.0, (), True),
        # a bound is suspicious only in a poor fit
        (9.81, 1.0, AT_BOUND, False),
        (9.81, 5.0, AT_BOUND, True),
    ],
)
def test_a_hopeless_fit_doubts_the_units(gravity, ratio, reasons, said, monkeypatch):
    found, quality = _ended(gravity, ratio, reasons)
    monkeypatch.setattr(_fit_result.Result, "quality", [quality])
    assert ("deg or rad, ms or s" in found.remainder) == said


@pytest.mark.parametrize(
    ("drive", "fitted", "said"),
    [
        (Input("force_N", lambda s: s.force), False, "unit of the input force_N"),
        (Turning(lambda s: s.speed, lambda s: s.phase), False, "phase a tolerance"),
        (Turning(lambda s: s.speed, lambda s: s.phase), True, ""),
        (None, False, ""),
    ],
)
def test_a_hopeless_fit_doubts_the_drive(drive, fitted, said, monkeypatch):
    found, quality = _ended(9.81, 1001.0)
    found.problem.model = Model(preset("calibrated"), {}, drive)
    if fitted:
        phase = Parameter("phase", lambda model: model.system.phase)
        found.problem.parameters = (phase,)
    monkeypatch.setattr(_fit_result.Result, "quality", [quality])
    after = found.remainder.partition("mm or m).")[2]
    assert said in after
    assert bool(said) == bool(after)


@pytest.mark.parametrize(("ratio", "said"), [(0.49, True), (0.51, False)])
def test_a_stated_noise_that_is_too_large_is_said(ratio, said, monkeypatch):
    found, quality = _ended(9.81, ratio)
    monkeypatch.setattr(_fit_result.Result, "quality", [quality, quality])
    assert (f"but the residual is only {ratio:.3g}" in found.remainder) == said


def test_the_example_is_written_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = run("new-rig", "my-two_stops")
    assert "jaxcam simulate --rig my-two_stops.toml" in said
    code = (tmp_path / "my-two_stops.py").read_text()
    assert "class MyTwoStops(HybridSystem)" in code
    assert "my-two_stops.py:MyTwoStops" in (tmp_path / "my-two_stops.toml").read_text()
    assert "already exists" in refusal("new-rig", "my-two_stops")
    assert (tmp_path / "my-two_stops.py").read_text() == code
    (tmp_path / "my-two_stops.py").unlink()
    assert "my-two_stops.toml already exists" in refusal("new-rig", "my-two_stops")
    assert not (tmp_path / "my-two_stops.py").exists()
    # no class may be called that
    run("new-rig", "none")
    assert "class NoneRig(" in (tmp_path / "none.py").read_text()
    run("simulate", "--rig", "none.toml", "--state=0,0.8", "--t1=0.1")


@pytest.mark.parametrize("name", ["3", "a b", "cart.py", "", "nowhere/cart", "../.."])
def test_names_that_are_no_names_are_refused(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    refusal("new-rig", name)
    assert not list(tmp_path.iterdir())


def test_the_command_that_new_rig_prints_works(rig):
    said = run("new-rig", "other")
    (line,) = re.findall("Try it: jaxcam (.*)", said)
    assert "Other, from 0 to 3 s: 4 impacts" in run(*line.split())


def test_nominal_values_come_from_the_rig_file(rig):
    text = (rig / "cart.toml").read_text().replace("value = 40.0", "value = 42.0")
    (rig / "other.toml").write_text(text)
    line = ["simulate", "--state=0,0.8", "--t1=0.1", "--json=-"]

    def stiffness(*words):
        return json.loads(run(*line, *words))["parameters"]["stiffness"]

    assert stiffness("--rig=other.toml") == 42.0
    assert stiffness("--rig=other.toml", "--system=cart.py:Cart") == 42.0
    assert stiffness("--system=cart.py:Cart") == 40.0
    assert stiffness("--system=cart.py:Cart", "--set=stiffness=39") == 39.0
    cam = json.loads(
        run("simulate", f"--rig={DEMO_RIG / 'rig.toml'}", "--turns=0.1", "--json=-")
    )
    assert cam["system"] == "cam-follower"


def test_a_driven_system_is_simulated_by_turns(rig):
    for kind in (".py", ".toml"):
        shutil.copy(ROOT / "docs" / "rigs" / f"two_stops{kind}", rig)
    found = json.loads(
        run(
            *("simulate", "--rig=two_stops.toml", "--set=speed=12"),
            *("--state=0,0", "--turns=2", "--json=-"),
        )
    )
    assert found["t1"] == pytest.approx(2 * 2 * np.pi / 12)
    assert found["system"] == "TwoStops"


def test_a_rig_between_two_stops_starts_at_rest_or_as_its_file_states(rig):
    """No state in contact is known of it; the units are those of the rig file."""
    for kind in (".py", ".toml"):
        shutil.copy(ROOT / "docs" / "rigs" / f"two_stops{kind}", rig)
    text = (rig / "two_stops.toml").read_text()
    line = ["simulate", "--set=speed=12", "--turns=2"]
    at_rest = run(*line, "--rig=two_stops.toml")
    assert "Start at rest: " in at_rest
    given = run(*line, "--rig=two_stops.toml", "--state=0,0")
    assert at_rest.splitlines()[-1] == given.splitlines()[-1]
    (rig / "begun.toml").write_text("start = [0.0, 0.8]\n" + text)
    begun = run(*line, "--rig=begun.toml")
    assert "Start as the rig file states: " in begun and "0.8" in begun
    stated = run(*line, "--rig=two_stops.toml", "--state=0,0.8")
    assert begun.splitlines()[-1] == stated.splitlines()[-1]
    (rig / "wrong.toml").write_text("start = [0.0]\n" + text)
    assert "`start` must be [" in refusal(*line, "--rig=wrong.toml")
    said = run(
        *("diagram", "--rig=two_stops.toml", "--from=11", "--to=12", "--points=2"),
        *("--turns=3", "--keep=1"),
    )
    assert "Start at rest: " in said


def test_units_of_known_parameters_are_printed(rig):
    """Of a parameter without a tolerance too, which is not fitted."""
    text = (rig / "cart.toml").read_text()
    text = text.replace("{value = 40.0, tolerance = 3.0,", "{value = 40.0,")
    (rig / "known.toml").write_text(text)
    units = Source(rig=rig / "known.toml").units()
    assert units["stiffness"] == "1/s^2" and units["left"] == "m"
    assert "restitution_left" not in units
    axis = Axis.of("stiffness", "Cart", units)
    assert axis.name == "stiffness in 1/s^2"
    assert axis.shown(40.0) == "40 1/s^2"
    assert Axis.of("restitution_left", "Cart", units).name == "restitution_left"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("simulate --system cart.py:Card --state 0,1 --t1 1", "is `Cart` meant?"),
        ("simulate --system cart.py --state 0,1 --t1 1", "as in cart.py:Cart"),
        ("simulate --system card.py:Cart", "no such file"),
        ("simulate --rig card.toml", "no such file"),
        ("simulate --rig cart.toml --speed 3", "--speed applies only to cam-follower"),
        ("simulate --rig cart.toml --state 0,1", "has no forcing period"),
        ("simulate --rig cart.toml --system a.json", "leave out --rig"),
        ("simulate cart.py:Cart", "a system of your own with --system"),
        ("simulate --rig cart.toml --set stifness=1", "the parameters are stiffness"),
        ("basins --rig cart.toml --turns 30", "give its corners"),
        (
            "basins --rig cart.toml --low=-0.04,0 --high 0,1 --cluster local",
            "worker processes cannot load Cart",
        ),
        ("fit case --rig cart.toml", "case: there is no such folder"),
        ("fit . --rig cart.toml", "there is no recording"),
        ("fit runs --rig nosuch.toml", "nosuch.toml does not exist"),
        ("fit runs", "runs contains no rig.toml; give the rig file with --rig"),
        (
            "fit . --system cart.py:Cart",
            "contains no rig.toml; give the rig file with --rig",
        ),
        ("fit runs --rig cart.toml", "the column `position_m` is missing"),
        ("fit . --system cart.json --rig cart.toml", "name a Python file"),
        ("diagnose runs --rig cart.toml", "the column `position_m` is missing"),
        ("diagnose one --rig cart.toml --next", "--next recommends a drive speed"),
        (
            "diagnose one --rig cart.toml",
            "There is only 1 recording; give at least two",
        ),
        ("fit one --rig known.toml", "There is nothing to fit"),
        ("demo --case one --rig cart.toml", "is not a cam-follower rig"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(rig, line, words):
    for folder, column in (("runs", "place_m"), ("one", "position_m")):
        (rig / folder).mkdir()
        rows = "".join(f"{k / 1000},{0.01 * np.sin(k / 30):.6f}\n" for k in range(300))
        (rig / folder / "run.csv").write_text(f"time_s,{column}\n{rows}")
    text = (rig / "cart.toml").read_text()
    (rig / "known.toml").write_text(
        re.sub(r"tolerance = [\d.]+", "tolerance = 0", text)
    )
    assert words in refusal(*line.split())


def test_from_recordings_to_a_fitted_system(rig):
    """Every parameter within 4 standard errors; the file that is written comes back."""
    write_case(rig / "case")
    said = run(
        *("fit", "case", "--system=cart.py:Cart", "--rig=cart.toml"),
        *("--json=fitted.json", "--out=fit"),
    )
    assert "The optimum was reached." in said
    # laws from the impacts on either stop
    assert "left stop: Constant restitution" in said and "right stop:" in said
    assert (rig / "fit" / "residuals_time.png").exists()
    assert said.count("Rough estimates of the restitution from single impacts") == 1
    # there is no drive to draw them by
    assert not (rig / "fit" / "residuals_phase.png").exists()
    fitted = json.loads((rig / "fitted.json").read_text())
    for one in fitted["about"]["parameters"]:
        off = abs(one["value"] - TRUTH[one["name"]])
        assert off < 4 * one["stderr"], one
        assert one["stderr"] < 1e-2 * abs(one["value"])
    assert fitted["source"] == f"{rig / 'cart.py'}:Cart"
    line = ["simulate", "--system=fitted.json", "--state=0,1.2", "--t1=1"]
    again = json.loads(run(*line, "--json=-"))
    assert again["parameters"]["stiffness"] == pytest.approx(41.5, rel=1e-3)
    assert again["system"] == "Cart"
    shutil.move(rig / "cart.py", rig / "moved.py")
    assert "which does not exist; restore it" in refusal(*line)


def test_a_system_that_cannot_be_saved_is_fitted_all_the_same(rig):
    code = (rig / "cart.py").read_text()
    code = code.replace("import jax.numpy", "import equinox as eqx\nimport jax.numpy")
    field = "    law: object = eqx.field(default=abs, static=True)\n"
    code = code.replace("    stiffness: float", f"{field}    stiffness: float")
    (rig / "cart.py").write_text(code)
    write_case(rig / "case")
    said = run("fit", "case", "--rig=cart.toml", "--json=fitted.json")
    assert "The system is not saved: `law` is a builtin" in " ".join(said.split())
    fitted = json.loads((rig / "fitted.json").read_text())
    assert fitted["about"]["parameters"][0]["name"] == "stiffness"
    assert "lacks" in refusal("simulate", "--system=fitted.json")


@pytest.mark.slow
def test_from_recordings_to_a_report(rig):
    """The example without its damping lacks damping; all is said in metres."""
    text = (rig / "cart.toml").read_text()
    known = text.replace("value = 0.3, tolerance = 0.2", "value = 0.0")
    (rig / "cart.toml").write_text(known)
    write_case(rig / "case")
    said = run("diagnose", "case", "--rig=cart.toml", "--out=report")
    assert "The model lacks viscous damping" in " ".join(said.split())
    verdict = json.loads((rig / "report" / "verdict.json").read_text())
    (effect,) = verdict["effects"]
    c1 = effect["parameters"]["c1"]
    assert c1["value"] == pytest.approx(0.25, abs=max(4 * c1["stderr"], 1e-3))
    assert verdict["fit"]["unit"] == "m"
    page = (rig / "report" / "index.html").read_text()
    words = re.sub(r"<style>.*?</style>|<img[^>]*>", "", page, flags=re.DOTALL)
    for foreign in ("rad/s", "rpm", "cam"):
        assert not re.search(rf"\b{foreign}\b(?!-follower)", words), foreign
    again = run("simulate", "--system=report/model.json", "--state=0,1.2", "--t1=1")
    assert "Cart, from 0 to 1 s" in again


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "diagram --from 11.9 --to 12 --points 2 --turns 20 --keep 5 --state 0,0",
            "TwoStops: 20 samples, speed from 11.9 to 12",
        ),
        (
            "basins --low=-0.04,-1 --high 0.07,1 --shape 4,4 --turns 30",
            "TwoStops: fractions of",
        ),
        ("continue --from 11 --to 13 --at 12 --max-points 2", "TwoStops: 5 points"),
    ],
)
def test_sweeps_and_branches_of_a_rig(rig, line, words):
    for kind in (".py", ".toml"):
        shutil.copy(ROOT / "docs" / "rigs" / f"two_stops{kind}", rig)
    command, *options = line.split()
    assert words in run(command, "--rig=two_stops.toml", *options)
