"""What is said of public measurements, whose physics is known from elsewhere."""

import os
import runpy
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.fitting import fit, Input, Model, Parameter, Problem, Sensor
from jaxcam.recordings import Recording, segment


HERE = Path(__file__).parents[1]
ROOT = Path(os.environ.get("JAXCAM_RECORDINGS", HERE / "../shared/recordings"))
real = pytest.mark.skipif(
    not (ROOT / "real").is_dir(),
    reason="there are no public recordings here; set JAXCAM_RECORDINGS to their folder",
)


class Cart(HybridSystem):
    """A mass with viscous friction, pushed by a force that was measured."""

    inverse_mass: float = 0.9
    viscous: float = 0.4
    force: float = 0.0

    def vector_field(self, t, state):
        push = self.inverse_mass * self.force - self.viscous * state[1]
        return jnp.stack([state[1], push])

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state


def _carted(force, interval, b=1.0, c=0.5):
    """Position of a cart from rest under a held force, exact from sample to sample."""
    x, v, found = 0.0, 0.0, []
    decay = np.exp(-c * interval)
    reach = (1 - decay) / c
    for level in force:
        found.append(x)
        end = b * level / c
        x, v = x + end * interval + (v - end) * reach, end + (v - end) * decay
    return np.array(found)


def test_a_measured_input_is_held_between_samples():
    rng = np.random.default_rng(3)
    interval, noise, runs = 2e-3, 1e-6, []
    time = interval * np.arange(600)
    for k in range(2):
        # each record has a force of its own, which jumps at every fifth sample
        force = np.repeat(rng.normal(size=120), 5)
        position = _carted(force, interval) + noise * rng.standard_normal(600)
        run = Recording(f"run{k}", time, {"position_m": position, "force_N": force})
        runs.append(segment(run, "position_m", noise=noise))
    model = Model(
        Cart(), {"position_m": Sensor(0, noise=noise)}, Input("force_N", _force)
    )
    problem = Problem.build(
        model,
        runs,
        [
            Parameter("1/mass", lambda m: m.system.inverse_mass),
            Parameter("viscous", lambda m: m.system.viscous),
        ],
    )
    found = fit(problem)
    for name, truth in (("1/mass", 1.0), ("viscous", 0.5)):
        one = found[name]
        assert one.value == pytest.approx(truth, abs=4 * one.stderr)
        assert one.stderr < 1e-3
    # the residuals are noise and nothing else: 1200 samples, six standard deviations
    assert found.cost == pytest.approx(1200, abs=6 * np.sqrt(2 * 1200))


def _force(system):
    return system.force


def _run_notebook(name: str) -> dict:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("JAXCAM_RECORDINGS", str(ROOT.resolve()))
        patch.syspath_prepend(HERE / "notebooks")
        return runpy.run_path(str(HERE / "notebooks" / name))


@pytest.fixture(scope="module")
def told():
    """All that the notebook on these recordings finds."""
    return _run_notebook("A3_real_recordings.py")


@pytest.fixture(scope="module")
def strayed():
    """Errors of free runs, by set and model, from the notebook on them."""
    return _run_notebook("A4_free_runs.py")["strayed"]


@real
@pytest.mark.slow
def test_the_pendulum_rubs_and_stirs_the_air(told):
    found = told["found"]["pendulum"]
    # the small swing stops after a finite time, by 2.54e-3 of its energy scale per rad;
    # times the square of 8.0 rad/s that is 0.163 rad/s^2 of dry friction
    assert {"coulomb_friction", "quadratic_drag"} <= set(found.names)
    friction = {e.name: e for e in found.effects}["coulomb_friction"]
    assert friction.parameters["fc"].value == pytest.approx(0.163, rel=0.15)
    # and the viscous hinge of the textbook is not there
    assert found.rig["damping"].value < 0.01
    # what the large swing says of the small one
    before, after = told["moved"]["pendulum"]
    assert after < before / 3


@real
@pytest.mark.slow
@pytest.mark.parametrize("ball", ["baseball", "bowling_ball"])
def test_no_air_is_seen_by_heavy_balls(told, ball):
    """What the film leaves over of the baseball is smooth, but no drag of both."""
    assert set(told["found"][ball].names) <= {"unknown"}


@real
@pytest.mark.slow
@pytest.mark.parametrize("ball", ["tennis_ball", "whiffle_ball_1"])
def test_light_balls_are_dragged(told, ball):
    found = told["found"][ball]
    assert found.verdict == "effect"
    assert found.names in (("viscous_damping",), ("quadratic_drag",))
    before, after = told["moved"][ball]
    assert after < before / 5


@real
@pytest.mark.slow
@pytest.mark.parametrize("sheets", [8, 16, 100])
def test_paper_gives_back_less_of_faster_impacts(told, sheets):
    found = told["found"][f"marble on {sheets}"]
    assert "restitution_velocity" in found.names
    before, after = told["moved"][f"marble on {sheets}"]
    assert after < before


@real
@pytest.mark.slow
def test_the_stage_has_dry_friction(told):
    found = told["found"]["positioning stage"]
    assert "coulomb_friction" in found.names
    # regression of the measured force on acceleration, velocity and its sign, with
    # another differentiator: 91 kg and -3.2 N, with friction that is not smoothed
    mass = 1 / found.rig["1/mass"].value
    assert mass == pytest.approx(91.3, rel=0.05)
    assert found.rig["offset"].value * mass == pytest.approx(-3.2, rel=0.15)


@real
@pytest.mark.slow
def test_free_runs_of_the_stage_need_friction_by_direction(strayed):
    steps = strayed["stage"]
    seen = [one[0] for one in steps.values()]
    # each term explains more of the record that it was fitted to
    assert seen == sorted(seen, reverse=True)
    # the best published model that can be checked strays by 5.17 mm
    assert steps["more damping backwards"][1] < 5.17e-3 < steps["dry friction"][1]


@real
@pytest.mark.slow
@pytest.mark.parametrize("way", ["first to second", "second to first"])
def test_either_half_of_the_head_tells_the_other_of_a_surface(strayed, way):
    steps = strayed[f"head, {way}"]
    assert steps["a surface"][1] < steps["textbook"][1]
