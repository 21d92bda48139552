"""A sensor that drifts, or a cam that rises: the surface moves in time."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import measure, RealRig, simulate_rig
from jaxcam.recordings import read_rig, Recording, segment_case
from jaxcam.recordings._drive import read_drive
from jaxcam.recordings.cut import fit_surface
from jaxcam.recordings.cut._impact_points import impact_points, SurfacePoints
from jaxcam.recordings.cut._surface_drift import surface_drifts


RIG = read_rig(DEMO_RIG / "rig.toml")
NOISE = RIG.sensors.follower_floor
SPEEDS = (136.5, 146.0, 158.0)
FOLLOWER = "follower_angle_rad"
# displacements as functions of time (s): settling, oscillating, and a single step
MOVED = {
    "settles": lambda t: 1.4e-3 * (1 - np.exp(-t / 0.7)),
    "wanders": lambda t: 1e-3 * np.sin(3 * t),
    "steps": lambda t: 5e-4 * (t > 0.9),
}


@pytest.fixture(scope="module")
def still():
    rng, runs = np.random.default_rng(21), []
    for rpm in SPEEDS:
        truth = simulate_rig(RealRig(), rpm * math.pi / 30, 2.0, settle=6.0)
        turned = truth.turned - 2 * np.pi * np.floor(truth.turned[0] / (2 * np.pi))
        channels = {
            "cam_angle_rad": measure(turned, RIG.sensors.cam_noise, 20000, rng),
            FOLLOWER: measure(truth.angle, RIG.sensors.follower_noise, 40000, rng),
        }
        runs.append(Recording(f"{rpm} rpm", truth.time, channels))
    return runs, segment_case(runs, RIG)


def moved(runs, by):
    return [
        dataclasses.replace(
            run, channels={**run.channels, FOLLOWER: run[FOLLOWER] + by(run.time)}
        )
        for run in runs
    ]


def drifts_of(runs):
    drives = [read_drive(run) for run in runs]
    surface = fit_surface(runs, RIG, drives)
    seen = [impact_points(*pair, FOLLOWER, NOISE) for pair in zip(runs, drives)]
    return surface_drifts(runs, drives, surface, seen, NOISE)


def test_a_surface_at_rest_does_not_drift(still):
    assert drifts_of(still[0]) is None


@pytest.mark.parametrize("seed", range(4))
def test_an_error_of_the_profile_is_no_displacement(seed, unchecked_types):
    """Ten noises at the twelfth harmonic, seen at two angles of each turn; and an
    offset of five noises in one recording of three.
    """
    rng, runs, drives, seen = np.random.default_rng(seed), [], [], []
    time = np.arange(0.0, 2.0, 5e-4)
    for k, rpm in enumerate(SPEEDS):
        angle = rpm * math.pi / 30 * time
        runs.append(Recording(f"{rpm}", time, {FOLLOWER: np.zeros(len(time))}))
        drives.append(SimpleNamespace(angle=angle))
        places = np.sort(rng.uniform(0, 2 * np.pi, 2))
        turned = (places + 2 * np.pi * np.arange(4)[:, None]).ravel()
        turned = turned + 0.02 * rng.standard_normal(len(turned))
        off = 10 * NOISE * np.cos(12 * turned) + 5 * NOISE * (k == 1)
        off += NOISE * rng.standard_normal(len(turned))
        at = np.interp(turned, angle, time)
        seen.append(SurfacePoints(at, turned, off, np.full(len(turned), NOISE)))
    flat = SimpleNamespace(angle=np.zeros_like)
    found = surface_drifts(runs, drives, flat, seen, NOISE)  # pyright: ignore
    assert found is None


@pytest.mark.parametrize("name", MOVED)
def test_the_displacement_is_found(still, name):
    """At impacts, to three standard deviations of a sample, except near a step, where
    the displacement is interpolated; to 1.2 such deviations in the rms.
    """
    runs, by = still[0], MOVED[name]
    found = drifts_of(moved(runs, by))
    assert found is not None
    impacts = [part.impacts.time for part in still[1]]
    pairs = zip(impacts, runs, found)
    mine = np.concatenate([np.interp(t, run.time, one) for t, run, one in pairs])
    times = np.concatenate(impacts)
    off = mine - by(times)
    off -= np.mean(off)
    if name == "steps":
        off = off[np.abs(times - 0.9) > 0.5]
    assert len(off) > 20
    assert np.max(np.abs(off)) < 3 * NOISE
    assert np.sqrt(np.mean(off**2)) < 1.2 * NOISE


@pytest.mark.parametrize("name", MOVED)
def test_segments_do_not_depend_on_a_displacement(still, name):
    """At least nine tenths of the impacts are found at the same times, to half a sample
    interval; all contacts are found, and end at the same times, to 4 ms; there are no
    others, except for short ones (less than 20 ms).
    """
    runs, before = still
    for old, new in zip(before, segment_case(moved(runs, MOVED[name]), RIG)):
        apart = np.abs(old.impacts.time[:, None] - new.impacts.time[None])
        assert np.mean(np.min(apart, axis=1) < 2.5e-4) >= 0.9
        assert abs(new.impacts.count - old.impacts.count) <= 0.1 * old.impacts.count
        ends = [one.stop.time for one in old.contacts]
        for end in ends:
            assert min(abs(one.stop.time - end) for one in new.contacts) < 4e-3
        for one in new.contacts:
            known = min(abs(one.stop.time - end) for end in ends) < 4e-3
            assert known or one.duration < 0.02
