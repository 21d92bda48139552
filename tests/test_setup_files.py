"""Rig files of systems of a user's own: what they state, and what is refused."""

import shutil
from pathlib import Path

import hostile_files
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, HealthCheck, settings, strategies as st

from jaxcam.fitting import Input, is_setup, Problem, read_setup, Turning
from jaxcam.fitting._repeated_samples import repeats_noted
from jaxcam.fitting.engine import DriveState
from jaxcam.fitting.own_systems import (
    classes_beside,
    Field,
    split_name,
    system_class,
    system_source,
)
from jaxcam.models import BouncingBall
from jaxcam.recordings import Recording, RecordingError, RigError, segment


ROOT = Path(__file__).parents[1]
RIGS = {
    name: ROOT / "docs" / "rigs" / f"{name}.toml"
    for name in ("two_stops", "pendulum_wall", "two_masses", "stage")
}
RIGS["cam"] = ROOT / "tests" / "own_rigs" / "cam.toml"

PLAIN = """
import equinox as eqx
import jax.numpy as jnp
from jaxcam import HybridSystem


class Cart(HybridSystem):
    state_names = ("position", "velocity")
    stiffness: float
    wall: float = -0.1
    teeth: int = 3
    name: str = eqx.field(default="cart", static=True)

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.stiffness * state[0]])

    def gap(self, t, state):
        return state[0] - self.wall

    def impact(self, t, state):
        return jnp.stack([state[0], -0.5 * state[1]])
"""
RIG = """
system = "cart.py:Cart"

[parameters]
stiffness = {value = 61.5, tolerance = 2.5, unit = "1/s^2"}

[channels.position_m]
sees = "position"
noise = 1e-5
"""


def written(tmp_path, rig=RIG, code=PLAIN):
    (tmp_path / "cart.py").write_text(code)
    (tmp_path / "cart.toml").write_text(rig)
    return tmp_path / "cart.toml"


def refusal(tmp_path, old, new, code=PLAIN):
    assert old in RIG
    file = written(tmp_path, RIG.replace(old, new), code)
    with pytest.raises(RigError) as caught:
        read_setup(file)
    hostile_files.said(caught.value)
    assert "/ca" in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", ["two_stops", "pendulum_wall", "two_masses", "cam"])
def test_textbook_rigs_with_a_drive_can_be_stated(name):
    setup = read_setup(RIGS[name])
    assert isinstance(setup.model.drive, Turning)
    assert setup.drive_channel in setup.channels
    assert is_setup(RIGS[name])
    for one in setup.parameters:
        assert one.tolerance > 0 and jnp.isfinite(one.where(setup.model))
    model = setup.model
    moved = model.driven(2.0, DriveState(*jnp.array([7.0, 3.0, 0.5])))
    assert float(moved.speed) == 3.0 and float(moved.phase) == pytest.approx(1.0)
    assert model.sees_acceleration == hasattr(moved, "acceleration")
    assert not model.sees_acceleration or float(moved.acceleration) == 0.5


def test_a_stage_with_a_measured_input_can_be_stated():
    setup = read_setup(RIGS["stage"])
    assert isinstance(setup.model.drive, Input) and setup.drive_channel is None
    assert setup.channels == ("position_m", "input_V")
    assert float(setup.model.system.voltage) == 0.0  # pyright: ignore


def test_numbers_arrive_where_they_belong():
    setup = read_setup(RIGS["cam"])
    system = setup.model.system
    assert float(system.profile.eccentricity) == 0.015  # pyright: ignore
    assert float(system.inertia) == 0.043  # pyright: ignore
    names = [one.name for one in setup.parameters]
    assert "restitution.r" in names and "inertia" not in names
    law = setup.parameters[names.index("restitution.r")]
    assert (law.tolerance, law.lower, law.upper) == (0.12, 0.0, 1.0)
    gyro = setup.model.sensors["gyro_rad_s"]
    assert gyro.observe == 1 and gyro.filtered and gyro.limit == 1.7453
    assert setup.references == {"spring_center": 0.27, "impact_speed": 0.3}


def test_two_readings_of_a_file_are_of_one_class(tmp_path):
    """Programs that were compiled for one serve the other."""
    one, other = (read_setup(RIGS["two_stops"]) for _ in range(2))
    assert type(one.model.system) is type(other.model.system)
    assert one.parameters == other.parameters
    assert one.model.drive == other.model.drive
    assert hash(Field("a.b")) == hash(Field("a.b")) and Field("a.b") != Field("a.c")
    # of the same length, within the same second
    file = written(tmp_path)
    assert float(read_setup(file).model.system.wall) == -0.1  # pyright: ignore
    written(tmp_path, code=PLAIN.replace("-0.1", "-0.2"))
    assert float(read_setup(file).model.system.wall) == -0.2  # pyright: ignore


def test_another_system_takes_the_place_of_that_of_the_file(tmp_path, monkeypatch):
    file = written(tmp_path, RIG.replace('system = "cart.py:Cart"', ""))
    (tmp_path / "elsewhere").mkdir()
    other = tmp_path / "elsewhere" / "other.py"
    other.write_text(PLAIN.replace("Cart", "Trolley"))
    monkeypatch.chdir(tmp_path)
    assert is_setup(file)
    setup = read_setup(file, "elsewhere/other.py:Trolley")
    assert type(setup.model.system).__name__ == "Trolley"
    cls = system_class("cart.py:Cart", tmp_path)
    assert type(read_setup(file, cls).model.system) is cls
    assert system_source(cls) == f"{tmp_path.resolve() / 'cart.py'}:Cart"
    assert cls in classes_beside(cls)
    assert system_source(BouncingBall) is None
    assert split_name(r"C:\rigs\cart.py") == (r"C:\rigs\cart.py", "")


def test_a_file_may_import_what_lies_beside_it(tmp_path):
    (tmp_path / "springs_of_the_cart.py").write_text("STIFFNESS = 3.0")
    code = "from springs_of_the_cart import STIFFNESS" + PLAIN
    file = written(tmp_path, code=code.replace("-0.1", "-STIFFNESS"))
    assert float(read_setup(file).model.system.wall) == -3.0  # pyright: ignore


def test_whole_numbers_and_words_are_what_the_field_says(tmp_path):
    rig = RIG.replace("[parameters]", '[parameters]\nteeth = 4\nname = "a"')
    system = read_setup(written(tmp_path, rig)).model.system
    assert system.teeth == 4 and isinstance(system.teeth, int)  # pyright: ignore
    assert system.name == "a"  # pyright: ignore
    # what is to be fitted varies, whatever its annotation says
    rig = RIG.replace(
        "[parameters]", "[parameters]\nteeth = {value = 4, tolerance = 1}"
    )
    assert read_setup(written(tmp_path, rig)).parameters[0].name == "teeth"


def test_nothing_known_beforehand(tmp_path):
    rig = RIG.replace("tolerance = 2.5", "tolerance = inf, lower = 0")
    (one,) = read_setup(written(tmp_path, rig)).parameters
    assert one.tolerance == np.inf and one.lower == 0.0


def test_a_drive_may_have_an_offset_that_is_fitted(tmp_path):
    text = (RIGS["two_stops"]).read_text()
    text = text.replace(
        "[parameters]", "[parameters]\nphase = {value = 0.1, tolerance = 0.2}"
    )
    shutil.copy(RIGS["two_stops"].with_suffix(".py"), tmp_path)
    (tmp_path / "rig.toml").write_text(text)
    setup = read_setup(tmp_path / "rig.toml")
    assert setup.parameters[0].name == "phase"
    assert float(setup.model.system.phase) == 0.1  # pyright: ignore


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('system = "cart.py:Cart"', "", 'begin it with system = "FILE.py:CLASS"'),
        ("cart.py:Cart", "cart.py", "as in cart.py:Cart"),
        ("cart.py:Cart", "card.py:Cart", "no such file"),
        ("cart.py:Cart", "cart.txt:Cart", "name a Python file"),
        ("cart.py:Cart", "cart.py:Card", "no class `Card` in it; is `Cart` meant?"),
        ("cart.py:Cart", "cart.py:Wheel", "its systems are Cart"),
        ("cart.py:Cart", "cart.py:jnp", "is not a HybridSystem"),
        (
            "cart.py:Cart",
            "cart.py:HybridSystem",
            "`HybridSystem` has no `vector_field`",
        ),
        ("[parameters]", "[parameter]", "is `parameters` meant?"),
        (
            "stiffness",
            "stifness",
            "contains `stifness`, but Cart has no such number; is",
        ),
        ("stiffness =", "a.b =", "contains `a.b`"),
        ("stiffness =", "teeth =", "`stiffness` of Cart has no value"),
        ("stiffness =", "stiffness = 3\nname =", "contains `name`, but Cart"),
        ("stiffness =", "stiffness = 3\nwall.x =", "contains `wall.x`"),
        ('{value = 61.5, tolerance = 2.5, unit = "1/s^2"}', '"a"', "is not a number"),
        ('{value = 61.5, tolerance = 2.5, unit = "1/s^2"}', "[1]", "a number in SI"),
        ("value = 61.5", "value = true", "must be a number"),
        ("value = 61.5", "value = nan", "must be a number"),
        ("value = 61.5, ", "", "`stiffness` in [parameters] has no `value`"),
        ("tolerance = 2.5", "tolerance = -2.5", "the negative tolerance -2.5"),
        ("tolerance = 2.5", "tolrance = 2.5", "is `tolerance` meant?"),
        ("tolerance = 2.5", "lower = 70", "must be between 70 and inf"),
        ("tolerance = 2.5", "lower = 70, upper = 60", "must be between 70 and 60"),
        ('unit = "1/s^2"', "unit = 3", "which is not text"),
        ("[channels.position_m]", "[channel.position_m]", "is `channels` meant?"),
        ("[channels.position_m]", "[channels.position_mm]", "call it `position_m`"),
        ("noise = 1e-5", "", "[channels.position_m] has no `noise`; add it."),
        ("noise = 1e-5", "nois = 1e-5", "has no `noise`; rename `nois`."),
        ("noise = 1e-5", "noise = 0", "is 0, but must be positive"),
        (
            "noise = 1e-5",
            'noise = {value = 1, unit = "mm"}',
            'in "mm", but must be in "m"',
        ),
        ("noise = 1e-5", "noise = 1e-5\nresolutoin = 1", "is `resolution` meant?"),
        ('sees = "position"', 'sees = "place"', '"position" or "velocity"'),
        ('sees = "position"', "", "has no `sees`; add it, or remove the table"),
        (
            '[channels.position_m]\nsees = "position"\nnoise = 1e-5',
            "[channels]",
            "[channels] is empty",
        ),
        (
            '[channels.position_m]\nsees = "position"\nnoise = 1e-5',
            "[channels]\nposition_m = 1e-5",
            "is not a table with `sees` and `noise`",
        ),
        ("[channels", '[drive]\nchannel = "a_rad"\n[channels', "contains `phase`, but"),
        (
            "[channels",
            '[input]\nchannel = "a_V"\nfield = "wal"\n[channels',
            "[drive] or [input] contains `wal`",
        ),
        (
            "[channels",
            '[input]\nchannel = "a_mV"\nfield = "wall"\n[channels',
            "call it `a_V`",
        ),
        (
            "[channels",
            '[input]\nchannel = "a_V"\nfield = "stiffness"\n[channels',
            "remove the tolerance",
        ),
        (
            "[channels",
            '[input]\nchannel = "a_V"\nfield = "wall"\ninterpolation = "x"\n[channels',
            'must be "hold" or "linear"',
        ),
        (
            "[channels",
            '[input]\nchannel = "a_V"\nfield = "wall"\ninterpolate = "hold"\n[channels',
            "is `interpolation` meant?",
        ),
        ("[channels", "[input]\n[drive]\n[channels", "both [drive] and [input]"),
        ("[channels", "[input]\nchannel = 3\n[channels", "must be a word"),
        ("[channels", "[references]\ncenter = 1\n[channels", "unknown key `center`"),
        ("[channels", "[references]\nslip_speed = 0\n[channels", "must be positive"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, old, new, words):
    assert words in refusal(tmp_path, old, new)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("import jax.numpy as jnp", "import nothing_of_this_name", "line 3 raises Mod"),
        ("wall: float = -0.1", "wall: float = lenght", "line 10 raises NameError"),
        ("class Cart", "clas Cart", "line 7 is not valid Python"),
        ("from jaxcam", "raise SystemExit(3)\nfrom jaxcam", "SystemExit"),
        ("    def impact", "    def strike", "`Cart` has no `impact`"),
        ('state_names = ("position", "velocity")', "pass", "does not name its states"),
        ("-self.stiffness", "-self.stifness", "`vector_field` of Cart fails"),
        ("return state[0] - self.wall", "return state - 1.0", "the shape (2,), but"),
        ("return jnp.stack([state[0], -0.5 * state[1]])", "return -state[1]", "(2,)"),
        (
            "return state[0] - self.wall",
            "return state[0] if state[1] > 0 else state[0] - self.wall",
            "`gap` of Cart needs the values of time or state",
        ),
        ("state[0] - self.wall", "float(state[0])", "jnp.where instead of if"),
        ("state[0] - self.wall", "(0.0, 1.0)[state[0].astype(int)]", "jax.numpy"),
        ("state[0] - self.wall", "1 / 0", "`gap` of Cart fails (cart.py: line"),
        ("return state[0] - self.wall", "state[0]", "`gap` of Cart returns nothing"),
        (
            "return jnp.stack([state[1], -self.stiffness * state[0]])",
            "return state[1], -self.stiffness * state[0]",
            "`vector_field` of Cart returns a tuple; return an array",
        ),
        (
            "return jnp.stack([state[0], -0.5 * state[1]])",
            "return jnp.stack([state, state])",
            "required for its 2 state names; correct",
        ),
        (
            "    teeth",
            "    period = property(lambda self: self.sped)\n    teeth",
            "`period` of Cart fails (cart.py: line",
        ),
        (
            "    teeth",
            '    constraint_names = "left", "right"\n    teeth',
            "2 `constraint_names`, but 1 gap; give",
        ),
        (
            "    def gap",
            '    def check(self):\n        raise ValueError("Too stiff.")\n    def gap',
            "cart.toml: Too stiff.",
        ),
        (
            "    teeth",
            "    def __check_init__(self): 1 / 0\n    teeth",
            "cannot be created",
        ),
    ],
)
def test_what_is_wrong_with_the_code_is_said(tmp_path, old, new, words):
    assert old in PLAIN
    assert words in refusal(tmp_path, "", "", PLAIN.replace(old, new))


def test_a_fault_of_a_branch_is_not_said_of_the_vector_field_that_calls_it(tmp_path):
    code = PLAIN.replace("HybridSystem", "SwitchedSystem")
    code = code.replace("from jaxcam import", "from jaxcam.hybrid import")
    plain = "    def switching(self, t, state):\n        return state[1]\n\n"
    plain += "    def branch(self, t, state, sides):"
    code = code.replace("    def vector_field(self, t, state):", plain)
    short = code.replace("jnp.stack([state[1], -self", "jnp.stack([-self")
    assert short != code
    said = refusal(tmp_path, "", "", short)
    assert "`branch` of Cart has the shape (1,), but (2,) is required" in said


@settings(max_examples=60, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_any_text_is_read_or_refused_in_a_sentence(tmp_path, data):
    text = RIG
    for _ in range(data.draw(st.integers(1, 2))):
        mark = data.draw(st.sampled_from(["=", " ", ",", '"', "."]))
        text = data.draw(hostile_files.worded(text, mark))
    (tmp_path / "cart.py").write_text(PLAIN)
    file = tmp_path / "cart.toml"
    file.write_bytes(hostile_files.encoded(text, "utf-8"))
    try:
        setup = read_setup(file)
    except RigError as error:
        hostile_files.said(error)
    else:
        assert setup.channels


def test_a_problem_is_built_from_recordings_that_are_cut(tmp_path):
    """Two swings of known stiffness; one that is read has the same compiled program."""
    setup = read_setup(written(tmp_path))
    time = 1e-3 * np.arange(400)
    rng = np.random.default_rng(4)
    parts = []
    for size in (0.02, 0.03):
        motion = size * np.cos(np.sqrt(62.0) * time)
        noisy = motion + 1e-5 * rng.standard_normal(len(time))
        run = Recording(f"{size}", time, {"position_m": noisy})
        parts.append(segment(run, "position_m", noise=1e-5))
    problem = setup.problem(parts)
    assert isinstance(problem, Problem)
    assert problem.names == ("stiffness",)


@pytest.mark.parametrize("steps", [0, 1])
def test_a_sensor_that_shows_no_motion_is_refused(tmp_path, steps):
    """Constant, or toggling between two codes 1e-5 m apart."""
    rig = RIG.replace("noise = 1e-5", "noise = 1e-5\nresolution = 1e-5")
    setup = read_setup(written(tmp_path, rig))
    time = 1e-3 * np.arange(60)
    still = 0.01 + 1e-5 * steps * (np.arange(60) % 2)
    run = Recording("still", time, {"position_m": still})
    with pytest.raises(RecordingError, match="still: the channel `position_m` is 0.01"):
        setup.segments([run])


def _moving(samples):
    return Recording("run", np.arange(len(samples)) / 100.0, {"x_m": samples})


def test_stale_samples_in_fast_motion_are_noted():
    """Every value twice: half of the samples repeat the one before. Samples that are
    rounded, that rest, or that jump now and then do not.
    """
    time = np.arange(400) / 100.0
    swing = np.round(np.sin(4 * time), 3)
    stale = _moving(np.repeat(swing[::2], 2))
    (note,) = repeats_noted(stale, ["x_m"]).meta["notes"]
    assert "% of the samples of `x_m` repeat the one before" in note
    steps = np.repeat([0.0, 1.0, 3.0, 2.0], 100)
    for samples in (swing, np.round(0.01 * swing, 3), steps):
        assert "notes" not in repeats_noted(_moving(samples), ["x_m"]).meta
