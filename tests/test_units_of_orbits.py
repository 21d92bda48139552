"""Whether two states are equal does not depend on the units that they are in."""

import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import InUnits

import variational
from continuation import orbits_near, periodic_orbit
from jaxcam.models import ImpactOscillator
from jaxcam.sweeps import Map, Stroboscopic
from jaxcam.sweeps.attractors import label_names, settle
from variational.orbits import inadmissible


OSCILLATOR = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
#: on P(1,1), and on P(6,6), to all digits after many turns
STARTS = np.array([[-0.66, 0.02], [-1.05037565, 0.19006401]])
#: units of length and time: metres and seconds, micrometres and ms, and the other way
UNITS = [(1.0, 1.0), (1e-6, 1e-3), (1e6, 1e3)]


def in_units(length, time):
    """The oscillator in these units, and what its states are multiplied by."""
    units = np.array([length, length / time])
    numbers = (jnp.asarray(x) for x in (units, length, time, np.zeros(2)))
    return InUnits(OSCILLATOR, *numbers), units


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_labels(length, time):
    """P(1,1) and P(6,6) after 400 turns; neither after 3, in any units."""
    system, units = in_units(length, time)
    section = Stroboscopic(system, lanes=16)
    _, labels = settle(section, STARTS * units, 400, 24)
    assert label_names(labels).tolist() == ["P(1,1)", "P(6,6)"]
    _, early = settle(section, np.array([[-0.3, 0.5]]) * units, 24, 24)
    assert label_names(early).tolist() == ["aperiodic"]


@pytest.mark.parametrize("length", [1.0, 1e-7, 1e7])
def test_labels_of_a_map(length):
    """The logistic map at 3.2 has period 2, at 4 none, in any units."""

    def logistic(x, rate):
        return rate * x * (1 - x / length)

    for rate, name in ((3.2, "period 2"), (4.0, "aperiodic")):
        section = Map(logistic, rate)
        _, labels = settle(section, np.array([[0.3 * length]]), 400, 24)
        assert label_names(labels).tolist() == [name]


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_a_state_that_does_not_return_is_no_orbit(length, time):
    """Off the orbit by a thousandth of it: refused; on it to 1e-6: accepted."""
    system, units = in_units(length, time)
    plain = periodic_orbit(OSCILLATOR, STARTS[0])
    state = np.asarray(plain.state) * units
    with pytest.raises(ValueError, match="does not return"):
        variational.orbit_of(system, 1.001 * state)
    orbit = variational.orbit_of(system, state)
    np.testing.assert_allclose(orbit.multipliers, plain.multipliers, rtol=1e-6)


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_orbits_are_found_and_told_apart(length, time):
    system, units = in_units(length, time)
    found = orbits_near(system, np.vstack([STARTS[0], STARTS[0] * 1.01]) * units)
    assert len(found) == 1
    plain = periodic_orbit(OSCILLATOR, STARTS[0])
    np.testing.assert_allclose(
        np.asarray(found[0].state) / units, plain.state, rtol=1e-7
    )


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e6])
def test_penetration_is_judged_beside_the_size_of_gaps(size):
    def refusal(gap, speed):
        return inadmissible(
            {0: gap * size}, {0: speed * size}, 1e-12,
            gap_size=size, period=2 * np.pi, steps=32,
        )  # fmt: skip

    assert refusal(-1e-10, -1e-10) is None
    assert "falls to" in refusal(-1e-8, 0.0)
    assert "moves away" in refusal(0.0, -1e-8)
