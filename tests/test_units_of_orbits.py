"""Whether two states are equal does not depend on the units that they are in."""

import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import InUnits

import variational
from continuation import orbits_near, periodic_orbit
from continuation.orbits._periodic_orbit import _by_flow, _touches
from jaxcam.hybrid import Settings
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


def an_impact():
    """Time of the impact of P(1,1) and the state after it, and the orbit."""
    orbit = periodic_orbit(OSCILLATOR, STARTS[0])
    impacts = orbit.impacts
    return float(impacts.time[0]), np.asarray(impacts.after[0]), orbit


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_a_gap_is_closed_beside_its_size(length, time):
    """Its size is what the speed of the impact moves it by in 1/2.6 s: 0.16."""
    system, units = in_units(length, time)
    instant, after, _ = an_impact()
    for gap, closed in ((-1e-10, True), (0.0, True), (1e-10, True), (1e-7, False)):
        state = jnp.asarray(np.array([-gap, after[1]]) * units)
        assert _touches(system, state, instant * time, float(system.period)) == closed


@pytest.mark.parametrize(("length", "time"), UNITS)
@pytest.mark.parametrize("away", [-1e-8, -1e-12, 0.0, 1e-12])
def test_an_orbit_is_found_from_its_impact(length, time, away):
    """Also where t0 is next to the impact: then it starts half a flight later."""
    system, units = in_units(length, time)
    instant, after, plain = an_impact()
    t0 = instant * (1 + away)
    guess = np.array([-1e-7, after[1]]) * units
    orbit = periodic_orbit(system, guess, t0=t0 * time)
    moved = 0.0 if away == -1e-8 else float(plain.period) / 2
    assert float(orbit.time) / time == pytest.approx(t0 + moved, rel=1e-12)
    np.testing.assert_allclose(orbit.multipliers, plain.multipliers, rtol=1e-6)


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_an_impact_that_does_not_return_is_no_orbit(length, time):
    system, units = in_units(length, time)
    instant, after, plain = an_impact()
    with pytest.raises(ValueError, match="does not return"):
        variational.orbit_of(system, 1.001 * after * units, t0=instant * time)
    near = (1 + 1e-9) * after * units
    orbit = variational.orbit_of(system, near, t0=instant * time)
    np.testing.assert_allclose(orbit.multipliers, plain.multipliers, rtol=1e-6)


@pytest.mark.parametrize("length", [1.0, 1e-9, 1e6])
def test_newtons_method_on_the_motion_ends_at_the_orbit(length):
    system, units = in_units(length, 1.0)
    plain = periodic_orbit(OSCILLATOR, STARTS[0])
    guess = jnp.asarray(1.01 * np.asarray(plain.state) * units)
    settings, t0 = Settings(tolerance=1e-12), float(plain.time)
    orbit, why = _by_flow(system, guess, float(plain.period), 1, t0, settings)
    assert why is None
    np.testing.assert_allclose(np.asarray(orbit.state) / units, plain.state, rtol=1e-7)


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e6])
def test_penetration_is_judged_beside_the_size_of_gaps(size):
    def refusal(gap, speed):
        return inadmissible(
            {0: gap * size}, {0: speed * size}, 1e-12,
            gap_size=size, period=2 * np.pi, steps=32,
        )  # fmt: skip

    assert refusal(-1e-10, -1e-10) is None
    assert "falls to" in refusal(-1e-8, 0.0)
    assert "motion is away" in refusal(0.0, -1e-8)
