"""Diagnoses of a cart with a hidden state: what it is, and that it is modelled."""

from pathlib import Path

import hidden_state_rig as truth
import numpy as np
import pytest

from jaxcam import simulate
from jaxcam.discrepancy import diagnose, Policy
from jaxcam.discrepancy.terms import WithHidden
from jaxcam.fitting import read_setup


# each of them takes minutes
pytestmark = pytest.mark.slow

_RIG = Path(__file__).parents[1] / "docs" / "rigs" / "two_stops.toml"


def _diagnosed(hidden, seed, policy=Policy()):
    runs = truth.records(hidden, seed, duration=4.0)
    return diagnose(read_setup(_RIG), runs, case="cart", policy=policy)


def _gone(found):
    """Share of the squared error above the noise that is gone on held-out data."""
    before, after, noise = (
        x**2 for x in (found.heldout_before, found.heldout_after, found.noise_floor)
    )
    return 1 - (after - noise) / (before - noise)


def test_a_hidden_resonance_is_modelled():
    """Its frequency to 2 %, and a system that has it."""
    found = _diagnosed(truth.resonance(0.008, 13.4, 0.025), 31)
    (one,) = found.missing
    assert (found.verdict, one.kind, one.arguments) == (
        "unknown", "resonance", ("frequency",),
    )  # fmt: skip
    peak = one.grid[0][np.argmax(one.value)]
    assert peak == pytest.approx(13.4, rel=0.1)
    assert float(one.element.frequency) == pytest.approx(13.4, rel=0.02)  # pyright: ignore
    assert float(one.element.ratio) == pytest.approx(0.025, rel=0.2)  # pyright: ignore
    assert _gone(found) > 0.9
    system = found.system(0)
    assert isinstance(system, WithHidden)
    motion = simulate(system, [0.01, 0.3, 0.0, 0.0], 0.0, 4.0)
    assert motion.impacts.count > 1


def test_a_relaxation_is_modelled():
    found = _diagnosed(truth.relaxation(14.0, 0.07), 32)
    (one,) = found.missing
    assert (found.verdict, one.kind, one.arguments) == ("unknown", "force", ("memory",))
    assert float(one.element.time) == pytest.approx(0.07, rel=0.15)  # pyright: ignore
    assert _gone(found) > 0.9


def test_a_hysteresis_is_modelled():
    found = _diagnosed(truth.hysteresis(15.0, 0.009), 33)
    (one,) = found.missing
    assert (found.verdict, one.kind, one.arguments) == ("unknown", "force", ("memory",))
    assert type(one.element).__name__ == "Hysteresis"
    assert float(one.element.limit) == pytest.approx(0.009, rel=0.15)  # pyright: ignore
    assert _gone(found) > 0.9


@pytest.mark.parametrize("seed", [34, 35])
def test_nothing_is_none(seed):
    found = _diagnosed(truth.nothing(), seed)
    assert (found.verdict, found.missing) == ("none", ())


def test_a_vibration_is_no_resonance():
    found = _diagnosed(truth.shaken(0.3, 11.3), 36, Policy(elements=2))
    assert all(one.kind != "resonance" for one in found.missing)
