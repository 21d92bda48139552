"""Periods and labels, of sequences that are known and of motions in closed form."""

import numpy as np
import pytest

import jaxcam
from jaxcam import sweeps
from jaxcam.models import ImpactOscillator
from jaxcam.parameters import pick
from jaxcam.sweeps import PoincareSection, return_times, Stroboscopic
from jaxcam.sweeps.attractors import drifting, label, periods
from jaxcam.sweeps.attractors._label import label_names
from jaxcam.sweeps.attractors._unique_rows import unique_rows


OSCILLATOR = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
#: on P(1,1), and on P(6,6), to all digits after many turns
START = np.array([[-0.66, 0.02], [-1.05037565, 0.19006401]])


@pytest.fixture(scope="module")
def settled():
    return Stroboscopic(OSCILLATOR, lanes=16).sample(START, 400, 24)


def test_periods_of_cycles():
    """Cycles of length 1 to 12 within 24 points, and noise."""
    k = np.arange(24)
    rng = np.random.default_rng(0)
    cycles = [np.cos(2 * np.pi * k / n) + 0.1 * np.sin(2 * np.pi * k / n)
              for n in range(1, 13)]  # fmt: skip
    lanes = np.stack([*cycles, rng.uniform(size=24), np.full(24, np.nan)])
    assert periods(lanes[..., None]).tolist() == [*range(1, 13), 0, 0]


@pytest.mark.parametrize("multiplier", [-0.5, 0.5, 0.6j, -0.4 + 0.3j])
def test_a_motion_that_spirals_in_is_not_of_a_multiple_period(multiplier):
    """x_k = Re c^k: period 1 within the tolerance, or none yet; never another."""
    k = np.arange(24)[None] + np.arange(40)[:, None]
    lanes = np.real(multiplier**k)[..., None]
    found = periods(lanes, 1e-6, np.ones((40, 1)))
    assert set(found) == {0, 1}
    size = np.abs(multiplier) ** np.arange(40) * np.abs(multiplier - 1)
    assert np.all(found[size < 1e-7] == 1) and np.all(found[size > 1e-4] == 0)


@pytest.mark.parametrize(
    ("spread", "period"), [(1e-7, 2), (3e-6, 2), (2e-5, 4), (0.1, 4)]
)
def test_an_alternation_by_about_the_tolerance_is_no_longer_period(spread, period):
    """A cycle of four points that is almost one of two; the tolerance is 1e-6."""
    cycle = np.array([1.0, -1.0, 1.0 + spread, -1.0])
    lanes = np.tile(cycle, 8)[None, :, None]
    assert periods(lanes, 1e-6, np.ones((1, 1))).tolist() == [period]


@pytest.mark.parametrize(
    ("multiplier", "period"), [(0.95, 1), (-0.97, 1), (0.9 + 0.3j, 1), (0.97, 3)]
)
def test_a_slow_transient_is_told_from_a_motion_without_a_period(multiplier, period):
    """Powers of a multiplier inside the unit circle, beside a cycle, start within a
    hundredth of it; a rotation and the chaotic logistic map do not settle."""
    k = np.arange(60)
    slow = 0.01 * np.real(np.asarray(multiplier) ** k) + np.cos(2 * np.pi * k / period)
    turning = np.cos(2.0 * k)
    chaotic = np.empty((20, 60))
    chaotic[:, 0] = np.linspace(0.1, 0.4, 20)
    for step in range(59):
        chaotic[:, step + 1] = 3.9 * chaotic[:, step] * (1 - chaotic[:, step])
    lanes = np.concatenate([slow[None], turning[None], chaotic])[..., None]
    found = drifting(lanes)
    assert found[0] and not np.any(found[1:])
    assert periods(lanes[:1]) == 0


def test_a_diagram_says_what_has_not_settled():
    """Near the flip of the logistic map at 3, 60 iterations do not suffice."""
    logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
    found = sweeps.diagram(logistic, "mu", [2.7, 2.99, 3.9], [0.3], turns=100, keep=40)
    assert found.labels[:, 0].tolist() == ["period 1", "not settled", "aperiodic"]
    assert [one.label for one in found.ranges()] == found.labels[:, 0].tolist()


def test_labels_of_an_oscillator(settled):
    assert label_names(label(settled)).tolist() == ["P(1,1)", "P(6,6)"]


def test_samples_are_those_of_a_trajectory(settled):
    """On P(1,1) after 400 turns, and its impacts: to 1e-8."""
    run = jaxcam.simulate(
        OSCILLATOR, settled.states[0, -1], 0.0, 5 * float(OSCILLATOR.period)
    )
    assert np.abs(np.asarray(run.final) - settled.states[0, -1]).max() < 1e-8
    assert int(run.impacts.count) == settled.hits[0, -5:].sum()


def test_return_times_to_a_section(settled):
    """The velocity of P(1,1) falls through zero once in a period of 2 pi / omega."""
    section = PoincareSection(OSCILLATOR, lambda t, x: x[1], direction=1)
    samples = section.sample(settled.states[:1, -1], 8, 6)
    times = return_times(samples)
    assert times.shape == (1, 5)
    assert np.abs(times - 2 * np.pi / 2.6).max() < 1e-7
    assert np.all(samples.hits == 1)


def test_a_pick_is_a_path_and_says_what_there_is():
    one = pick(lambda s: s.omega, OSCILLATOR)
    assert one == pick("omega", OSCILLATOR) and one.names == ("omega",)
    two = pick(("wall", lambda s: s.damping), OSCILLATOR)
    assert two.names == ("wall", "damping") and two.several
    for wrong in ("size", lambda s: s.size):
        with pytest.raises(ValueError, match="omega, restitution, wall, damping"):
            pick(wrong, OSCILLATOR)


@pytest.mark.parametrize("shape", [(0, 2), (1, 1), (3, 0), (300, 2), (300, 5)])
def test_different_rows_are_those_of_numpy(shape):
    table = np.random.default_rng(1).integers(0, 3, shape).astype(float)
    rows, back = unique_rows(table)
    known, places = np.unique(table, axis=0, return_inverse=True)
    np.testing.assert_array_equal(rows, known)
    np.testing.assert_array_equal(back, places.reshape(-1))
