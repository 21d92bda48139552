"""Constants of single records: a mass, a drive's speed, the place of a wall."""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcam.discrepancy.policy import Policy
from jaxcam.discrepancy.search import segmented, setup_question
from jaxcam.fitting import fit, Parameter, Problem, read_setup, train
from jaxcam.recordings import Recording, RecordingError, RigError


# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")

CODE = """
import jax.numpy as jnp
from jaxcam import HybridSystem


class Shaken(HybridSystem):
    state_names = ("position", "velocity")
    stiffness: float = 10.0
    damping: float = 0.2
    mass: float = 1.0
    force: float = 2.0
    speed: float = 5.0
    wall: float = -10.0

    def vector_field(self, t, state):
        x, v = state
        push = self.force * jnp.sin(self.speed * t)
        held = self.stiffness * x + self.damping * v
        return jnp.stack([v, (push - held) / self.mass])

    def gap(self, t, state):
        return state[0] - self.wall

    def impact(self, t, state):
        return jnp.stack([state[0], -0.6 * state[1]])
"""
RIG = """
system = "shaken.py:Shaken"

[parameters]
stiffness = {value = 10.0, tolerance = 3.0, unit = "N/m"}
damping = {value = 0.2, tolerance = 0.2, lower = 0.0}
force = {value = 2.0, tolerance = 0.5}

[channels.position_m]
sees = "position"
noise = 1e-4

[records."run1*"]
mass = 0.31
speed = 4.0

[records."run2*"]
mass = {value = 0.52, unit = "kg"}
speed = 6.5

[records.run3]
mass = 0.8
speed = 7.5
"""
TRUTH = {"stiffness": 11.2, "damping": 0.27, "force": 2.31}
KNOWN = {"run1": (0.31, 4.0), "run2": (0.52, 6.5), "run3": (0.8, 7.5)}


@functools.cache
def recorded() -> tuple[Recording, ...]:
    """A run of each mass, shaken at a speed of its own; nothing is ever hit."""
    rng, runs = np.random.default_rng(3), []
    time = np.arange(3000) * 2e-3
    k, c, f = TRUTH.values()
    for name, (mass, speed) in KNOWN.items():

        def field(t, y):
            return [y[1], (f * np.sin(speed * t) - k * y[0] - c * y[1]) / mass]

        found = solve_ivp(
            field, (0, 6), [0.1, 0.0], "DOP853", time, rtol=1e-10, atol=1e-12
        )
        seen = found.y[0] + 1e-4 * rng.standard_normal(len(time))
        runs.append(Recording(name, time, {"position_m": seen}))
    return tuple(runs)


def setup_of(tmp_path, rig=RIG):
    (tmp_path / "shaken.py").write_text(CODE)
    (tmp_path / "shaken.toml").write_text(rig)
    return read_setup(tmp_path / "shaken.toml")


def test_a_fit_knows_what_each_record_was(tmp_path):
    """One stiffness explains runs of three masses, each shaken at its own speed."""
    setup = setup_of(tmp_path)
    problem = setup.problem(recorded())
    assert problem.names == ("stiffness", "damping", "force", "mass", "speed")
    found = fit(problem)
    assert found.converged, found.message
    assert found.free == ("stiffness", "damping", "force")
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 4 * found[name].stderr, name
        assert found[name].stderr < 0.05 * value
    for name, (mass, speed) in KNOWN.items():
        system = found.model(name).system
        assert (float(system.mass), float(system.speed)) == (mass, speed)
    with pytest.raises(ValueError, match="known for each record"):
        fit(problem, free=["mass"])
    with pytest.raises(ValueError, match="shared by all recordings"):
        train(problem, lambda model: model.system.stiffness)


def test_a_recording_says_it_itself(tmp_path):
    """From Python a recording carries its constants, and is nearer than the rig."""
    setup = dataclasses.replace(setup_of(tmp_path), records={})
    runs = [
        dataclasses.replace(run, constants={"mass": m, "speed": w})
        for run, (m, w) in zip(recorded(), KNOWN.values())
    ]
    values = np.asarray(setup.problem(runs).start.values)
    np.testing.assert_array_equal(values[:, 3:], list(KNOWN.values()))
    both = dataclasses.replace(setup, records={"run*": {"mass": 9.0, "speed": 1.0}})
    values = np.asarray(both.problem(runs).start.values)
    np.testing.assert_array_equal(values[:, 3:], list(KNOWN.values()))


def test_a_record_that_says_nothing_has_the_value_of_the_rig(tmp_path):
    setup = setup_of(tmp_path, RIG.replace("[records.run3]", "[records.run9]"))
    values = np.asarray(setup.problem(recorded()).start.values)
    np.testing.assert_array_equal(values[2, 3:], [1.0, 5.0])


@pytest.mark.slow
def test_a_diagnosis_knows_it_too(tmp_path):
    """The terms that could be missing are fitted beside the same constants."""
    setup = setup_of(tmp_path)

    def said(words, share):
        pass

    parts = segmented(setup, recorded(), said, {})
    question = setup_question(*parts, None, said, Policy())
    assert question.rig == ("stiffness", "damping", "force")
    problem = question.problem
    places = [problem.names.index(name) for name in ("mass", "speed")]
    values = np.asarray(problem.start.values)[:, places]
    np.testing.assert_array_equal(values, list(KNOWN.values()))
    system = problem.layout.at(problem.start.values[1]).system
    assert float(system.base.mass) == 0.52


def test_a_wall_that_was_moved_is_where_the_record_says(tmp_path):
    """A record is cut at its own wall, to which no tolerance of the rig reaches."""
    time = np.arange(1000) * 1e-3
    bounce = 0.05 * np.abs(np.sin(8 * time)) + 0.3
    run = Recording("run1", time, {"position_m": bounce}, constants={"wall": 0.3})
    setup = dataclasses.replace(setup_of(tmp_path), records={})
    (part,) = setup.segments([run])
    assert part.impacts.count >= 2
    (other,) = setup.segments([dataclasses.replace(run, constants={"wall": 0.1})])
    assert other.impacts.count == 0
    # a recording that is cut keeps its segments beside one that is not
    mine = dataclasses.replace(part, flights=part.flights[:2])
    again, kept = setup.segments([run, mine])
    assert kept.flights is mine.flights and len(again.flights) == len(part.flights)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mass = 0.31", "mas = 0.31", "is `mass` meant?"),
        ("mass = 0.31", 'mass = "a"', "must be a number"),
        ("mass = 0.31", "mass = nan", "must be a number"),
        ("mass = 0.31", "stiffness = 3.0", "fitted or measured"),
        ('[records."run1*"]', "[records]\nrun1 = 3\n[records.x]", "[records.run1]"),
        ("[records.run3]", "[record.run3]", "unknown key `record`; is `records`"),
    ],
)
def test_what_a_rig_file_says_wrongly(tmp_path, old, new, said):
    assert old in RIG
    with pytest.raises(RigError) as caught:
        setup_of(tmp_path, RIG.replace(old, new))
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_what_a_recording_says_wrongly(tmp_path):
    setup = dataclasses.replace(setup_of(tmp_path), records={})
    for constants, said in (
        ({"mas": 1.0}, "is `mass` meant?"),
        ({"mass": np.nan}, "not a finite number"),
        ({"mass": "heavy"}, "not a finite number"),
    ):
        run = dataclasses.replace(recorded()[0], constants=constants)
        with pytest.raises(RecordingError, match=said):
            setup.problem([run])
    first, second, _ = (
        dataclasses.replace(run, constants={"mass": mass})
        for run, mass in zip(recorded(), (0.3, np.inf, 0.5))
    )
    with pytest.raises(RecordingError, match="run2: the constant `mass`"):
        setup.problem([first, second])
    run = dataclasses.replace(recorded()[0], constants={"stiffness": 3.0})
    with pytest.raises(ValueError, match="called 'stiffness'"):
        setup.problem([run])
    part = setup.segments([recorded()[0]])
    own = Parameter("k", lambda m: m.system.mass)
    run = dataclasses.replace(part[0].recording, constants={"mass": 1.0})
    part = dataclasses.replace(part[0], recording=run)
    with pytest.raises(ValueError, match="same number"):
        Problem.build(setup.model, [part], [own])
