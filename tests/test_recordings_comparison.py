"""Comparison with a model, flight by flight."""

import dataclasses
import json
import math
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import DEMO_SENSORS, RealRig, recording_text, simulate_rig
from jaxcam.recordings import (
    compare,
    merge,
    read_case,
    read_recording,
    read_rig,
    Recording,
    RecordingError,
    segment,
    segment_case,
)
from jaxcam.recordings.against_model import compare_case
from jaxcam.recordings.cut import Boundary, Contact
from jaxcam.recordings.files import read_recordings


SHARED = Path(__file__).parents[2] / "shared" / "recordings"
needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason="the shared recordings are not here"
)


class FallingBody(HybridSystem):
    gravity: float = 9.81

    def vector_field(self, t, state):
        return jnp.stack([state[1], -jnp.asarray(self.gravity)])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])


def true_rig(real: RealRig):
    """The rig file with the values of the rig that was recorded."""
    return read_rig(DEMO_RIG / "rig.toml").replace(
        cam_radius=real.height - real.half_height,
        cam_eccentricity=real.eccentricity,
        cam_center_x=real.center_x,
        cam_center_y=real.center_y,
        follower_half_height=real.half_height,
        inertia=1.0,
        spring_stiffness=real.stiffness_over_inertia,
        spring_hook_x=real.spring_hook_x,
        spring_elongation=real.spring_elongation,
        restitution=real.restitution,
    )


def recorded(folder, real, seed):
    rng = np.random.default_rng(seed)
    recordings = []
    for rpm in (137.0, 149.0):
        truth = simulate_rig(real, rpm * math.pi / 30, 4.0, settle=15.0)
        file = folder / f"run_{rpm}rpm.csv"
        file.write_text(recording_text(truth, rng, sensors=DEMO_SENSORS))
        recordings.append(read_recording(file))
    return segment_case(recordings, read_rig(DEMO_RIG / "rig.toml"))


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_nothing_is_left_where_nothing_is_missing(tmp_path, seed):
    real = RealRig(damping=0.0)
    found = compare_case(true_rig(real), recorded(tmp_path, real, seed))
    assert 0.9 < found.row("flight").ratio < 1.15
    assert 0.9 < found.row("contact").ratio < 1.15
    assert 0.7 < found.row("impact position").ratio < 1.3
    assert 0.7 < found.row("impact speed").ratio < 1.3


def test_what_is_missing_shows_in_its_own_mode(tmp_path):
    damped = RealRig(damping=0.3)
    case = recorded(tmp_path, damped, 3)
    found = compare_case(true_rig(damped), case)
    assert found.row("flight").ratio > 2
    assert found.row("contact").ratio < 1.15
    assert found.row("impact speed").ratio < 1.3
    wrong_law = true_rig(RealRig(restitution=0.5))
    assert compare_case(wrong_law, case).row("impact speed").ratio > 2
    sentence = found.sentence()
    assert "In flight, the follower angle differs from the model" in sentence
    # in the unit of the figures
    assert f"({1e3 * found.row('flight').rms:.2g} mrad rms over" in sentence


def test_the_demonstration_runs():
    case = segment_case(read_case(DEMO_RIG), read_rig(DEMO_RIG / "rig.toml"))
    shares = []
    rig = read_rig(DEMO_RIG / "rig.toml")
    found = compare_case(rig, case, progress=shares.append)
    assert shares == [1 / 3, 2 / 3, 1.0]
    modes = [row.mode for row in found.rows]
    assert modes == ["flight", "contact", "impact position", "impact speed"]
    assert found.row("flight").worst_record in {part.recording.name for part in case}
    assert json.loads(json.dumps(found.to_json()))["rows"][0]["mode"] == "flight"
    assert found.table().row_count == 4
    assert found.notes == ()
    with pytest.raises(KeyError, match="there is flight of follower_angle_rad"):
        found.row("sliding")


def test_initial_states_are_fitted_exactly():
    time = np.arange(40) / 15
    height = 40 + 3 * time - 9.81 / 2 * time**2
    velocity = 3 - 9.81 * time
    drop = Recording("drop", time, {"height_m": height, "velocity_m_s": velocity})
    noise = {"height_m": 1e-3, "velocity_m_s": 1e-2}
    found = compare(
        FallingBody(),
        segment(drop, "height_m", noise=1e-3),
        observe={"height_m": 0, "velocity_m_s": lambda state: state[1]},
        noise=noise,
    )
    assert found.row("flight", "height_m").ratio < 1e-6
    assert found.row("flight", "velocity_m_s").ratio < 1e-6
    assert [row.unit for row in found.rows] == ["m", "m/s"]
    slower = compare(FallingBody(9.0), segment(drop, "height_m", noise=1e-3))
    # a wrong acceleration leaves a parabola less its best line
    left = 0.81 / 2 * (time**2 - np.polyval(np.polyfit(time, time**2, 1), time))
    expected = math.sqrt(np.sum(left**2) / (len(time) - 2))
    assert slower.row("flight").rms == pytest.approx(expected, rel=1e-6)


def test_a_model_that_cannot_follow_is_said():
    class Exploding(FallingBody):
        def vector_field(self, t, state):
            return jnp.stack([state[1], jnp.exp(1e3 * state[0])])

    time = np.arange(40) / 15
    drop = Recording("drop", time, {"height_m": 40 - 4.9 * time**2})
    found = compare(Exploding(), segment(drop, "height_m", noise=1e-3))
    assert found.rows == ()
    assert "could not follow 1 flights" in found.sentence()


def test_a_channel_without_a_unit_has_none():
    time = np.arange(40) / 15
    height = 40 + 3 * time - 9.81 / 2 * time**2
    drop = Recording("drop", time, {"position": height})
    found = compare(FallingBody(), segment(drop, "position", noise=1e-3))
    assert found.row("flight").unit == "" and "the position" in found.sentence()
    assert " rms" in found.sentence() and "  " not in found.sentence()


def test_samples_after_a_release_are_no_contact():
    """A release located 9 samples late does not add these samples to the contact."""
    time = np.arange(60) * 1e-2
    height = np.where(time < 0.3, 0.0, 0.05 * (time - 0.3))
    drop = Recording("drop", time, {"height_m": height})
    ends = [Boundary(t, 0.0, kind, "") for t, kind in ((0.0, "landing"), (0.395, ""))]
    contact = Contact(*ends, first=0, last=31, settled=0.1)
    part = segment(drop, "height_m", noise=1e-3)
    part = dataclasses.replace(part, flights=(), contacts=(contact,), sure=None)
    row = compare(FallingBody(), part).row("contact")
    assert row.samples == 21 and row.ratio < 1e-6


def test_unmeasurable_noise_is_refused():
    time = np.arange(40) / 15
    drop = Recording("drop", time, {"height_m": np.zeros(40)})
    with pytest.raises(RecordingError, match="cannot be measured"):
        compare(FallingBody(), segment(drop, "height_m"))


@needs_shared
def test_falling_balls():
    """A bowling ball falls freely, a perforated one does not."""
    ratios = {}
    found = []
    for file in sorted((SHARED / "real" / "ball_drop").glob("*.csv")):
        for drop in read_recordings(file, split="drop", gaps="split"):
            one = compare(FallingBody(), segment(drop, "height_m"))
            ratios[drop.name] = one.row("flight").ratio
            found.append(one)
    assert len(ratios) == 10
    assert ratios["bowling_ball_drop1"] < 6 and ratios["baseball_drop1"] < 6
    assert ratios["whiffle_ball_1_drop1"] > 30
    together = merge(found)
    assert together.row("flight").count == 10
    assert "whiffle_ball_1" in together.sentence()


@needs_shared
@pytest.mark.slow
def test_every_practice_case():
    """All of them are read, cut and compared; what was hidden shows in its mode."""
    folder = SHARED / "practice"
    rig = read_rig(SHARED / "rig.toml")
    keys = json.loads((folder / "keys.json").read_text())
    assert len(keys) == 14
    for key in keys:
        case = segment_case(read_case(folder / key["case"]), rig)
        g = key["rig"]
        true = rig.replace(
            cam_radius=g["R+d"] - g["d_spring"],
            cam_eccentricity=g["e"],
            cam_center_x=g["x0"],
            cam_center_y=g["y0"],
            follower_half_height=g["d_spring"],
            inertia=1.0,
            spring_stiffness=g["K/J"],
            spring_hook_x=g["x_A"],
            spring_elongation=g["L"],
            restitution=key["restitution"],
        )
        found = compare_case(true, case)
        ratio = {row.mode: row.ratio for row in found.rows}
        assert sum(len(part.flights) for part in case) > 60
        effects = {effect["effect"] for effect in key["effects"]}
        if not effects:
            assert 0.9 < ratio["flight"] < 1.15
            assert 0.9 < ratio["contact"] < 1.15
            assert 0.7 < ratio["impact speed"] < 1.3
        if effects & {"viscous_damping", "nonlinear_spring"} and key["level"] > 0.4:
            assert ratio["flight"] > 2 and ratio["contact"] < 1.15
        if "restitution_velocity" in effects:
            assert ratio["impact speed"] > 1.3
        if "cam_profile_error" in effects:
            assert ratio["flight"] < 1.1 and ratio["impact position"] > 3
