"""A cam with a dent: what is contact is found, and the dent is followed where it is."""

import dataclasses
import functools
import math

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import measure, RealRig, simulate_rig
from jaxcam.recordings import read_rig, Recording, segment_case
from jaxcam.recordings.cut._bend import bend_sizes, Seen, spread, WAVES, waves
from jaxcam.recordings.cut._firm_contact import firm_contact


NOMINAL = read_rig(DEMO_RIG / "rig.toml")
NOISE = NOMINAL.sensors.follower_floor
# just above valve float, where hops are low, and two faster ones
SPEEDS = (128.0, 141.0, 152.0)


@dataclasses.dataclass(frozen=True)
class Dented(RealRig):
    """A rig whose cam is higher by `size` around `place`, over half-widths `width`."""

    size: float = 0.0
    place: float = 0.0
    width: float = 1.0

    def profile(self, harmonics: int = 48) -> np.ndarray:
        turned = 2 * np.pi * np.arange(256) / 256
        away = (turned - self.place + np.pi) % (2 * np.pi) - np.pi
        dent = self.size * np.exp(-((away / self.width) ** 2))
        added = 2 * np.fft.rfft(dent)[: harmonics + 1] / 256
        added[0] /= 2
        return super().profile(harmonics) + added


@functools.cache
def measured(rig: RealRig):
    """The runs of a rig, and how far the follower truly was from its cam."""
    rng = np.random.default_rng(11)
    runs, gaps = [], []
    for rpm in SPEEDS:
        truth = simulate_rig(rig, rpm * math.pi / 30, 2.0, settle=5.0)
        turned = truth.turned - 2 * np.pi * np.floor(truth.turned[0] / (2 * np.pi))
        cam = measure(turned, NOMINAL.sensors.cam_noise, 20000, rng)
        angle = measure(truth.angle, NOMINAL.sensors.follower_noise, 40000, rng)
        channels = {"cam_angle_rad": cam, "follower_angle_rad": angle}
        runs.append(Recording(f"{rpm:g} rpm", truth.time, channels))
        gaps.append(truth.angle - height(rig, turned))
    return runs, gaps


def height(rig: RealRig, turned) -> np.ndarray:
    return np.sum(
        [w * np.exp(1j * k * turned) for k, w in enumerate(rig.profile())], axis=0
    ).real


def touched(gap) -> np.ndarray:
    return np.abs(gap) < 1e-3 * NOISE


@pytest.mark.parametrize(
    ("size", "place", "width"),
    [
        (1.5e-4, 3.6, 0.25),
        pytest.param(-2.5e-4, 2.4, 0.15, marks=pytest.mark.slow),
        pytest.param(3e-4, 0.6, 0.4, marks=pytest.mark.slow),
    ],
    ids=["where it is released", "a hollow", "a wide one"],
)
def test_a_dented_cam_is_cut_right(size, place, width):
    """What counts as contact is within a noise of the cam, nine tenths of what touches
    it is contact, and the cam is known to 0.3 noises where it is touched."""
    rig = Dented(damping=0.0, size=size, place=place, width=width)
    runs, gaps = measured(rig)
    for gap, part in zip(gaps, segment_case(runs, NOMINAL)):
        contact = np.zeros(len(gap), dtype=bool)
        for one in part.contacts:
            contact[one.first : one.last] = True
            assert np.max(gap[part.resting(one)], initial=0.0) < NOISE
        at = touched(gap)
        assert np.sum(at) > 200
        assert np.mean(contact[at]) > 0.9
        assert part.drive is not None and part.surface is not None
        turned = part.drive.angle[at]
        off = part.surface.angle(turned) - height(rig, turned)
        assert np.sqrt(np.mean(off**2)) < 0.3 * NOISE


def test_a_round_cam_is_not_bent():
    runs, _ = measured(Dented(damping=0.0))
    surface = segment_case(runs, NOMINAL)[0].surface
    assert surface is not None
    np.testing.assert_array_equal(surface.bend, np.zeros(WAVES))


def test_firm_contact_is_contact():
    """On average to a tenth of the noise; most of what touches the cam is firm."""
    runs, gaps = measured(Dented(damping=0.0))
    counts = np.zeros(2)
    for rpm, run, gap in zip(SPEEDS, runs, gaps):
        speed = rpm * math.pi / 30
        firm = firm_contact(run, NOMINAL, speed, "follower_angle_rad", NOISE)
        counts += np.sum(firm), np.sum(touched(gap))
        assert np.max(gap[firm], initial=0.0) < NOISE
        assert np.sum(gap[firm]) <= 0.1 * NOISE * np.sum(firm)
    assert counts[0] > 0.5 * counts[1]


def test_a_follower_that_flies_is_in_no_firm_contact():
    """A free flight of a second with the noise of the encoder."""
    time = np.arange(2000) * 5e-4
    rng = np.random.default_rng(2)
    x, v, angle = 0.3, 2.0, []
    for _ in time:
        angle.append(x + NOISE * rng.normal())
        a = RealRig().acceleration(x, v)
        x, v = x + 5e-4 * (v + 2.5e-4 * a), v + 5e-4 * a
    run = Recording("flight", time, {"a": np.array(angle)})
    assert not firm_contact(run, NOMINAL, 14.0, "a", NOISE).any()


def seen(rng, places, truth):
    """What samples at some angles say of a bend and of one number beside it."""
    rows = np.column_stack(
        [np.ones(len(places)), np.asarray(waves(jnp.asarray(places)))]
    )
    values = truth(places) + rng.normal(size=len(places))
    return Seen(rows.T @ rows, rows.T @ values)


def dent(places):
    return 2 * np.exp(-(((places - 2.0) / 0.2) ** 2))


def test_a_dent_that_two_records_show_is_followed_and_a_hop_of_one_is_not():
    """In units of the noise: 2 high, seen by 800 samples over two radians."""
    rng = np.random.default_rng(0)
    known, pull = np.array([1.0]), np.zeros(1)
    both = [seen(rng, rng.uniform(1.0, 3.0, 800), dent) for _ in range(2)]
    sizes = bend_sizes(both, known, pull, 1.0)
    assert np.all(sizes > 0)
    one = [both[0], seen(rng, rng.uniform(1.0, 3.0, 800), np.zeros_like)]
    assert not np.any(bend_sizes(one, known, pull, 1.0))
    apart = [both[0], seen(rng, rng.uniform(4.0, 6.0, 800), np.zeros_like)]
    assert not np.any(bend_sizes(apart, known, pull, 1.0))
    assert not np.any(bend_sizes(both[:1], known, pull, 1.0))


@pytest.mark.parametrize("length", [0.1, 0.4])
def test_a_bend_has_the_variance_it_is_given(length):
    basis = np.asarray(waves(jnp.linspace(0.0, 6.0, 7)))
    variance = basis**2 @ spread(length) ** 2
    np.testing.assert_allclose(variance, 1.0, rtol=1e-12)
