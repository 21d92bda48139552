"""The bilinear oscillator with a stiffer and stiffer stop (Shaw and Holmes 1983).

In the limit, the stop is a rigid wall with a coefficient of restitution of one. The
contact lasts about pi / sqrt(k), so that all errors are series in 1 / sqrt(k).
"""

import jax.numpy as jnp
import numpy as np
import pytest

import continuation
from jaxcam.models import BilinearOscillator, ImpactOscillator


STIFFNESSES = 1e4 * 4.0 ** np.arange(6)
SMALL = 1 / np.sqrt(STIFFNESSES)


def observed(orbit, time, velocity) -> list[float]:
    """State at the start of the period, time and velocity of the impact, and trace and
    determinant of the monodromy matrix.
    """
    monodromy = np.asarray(orbit.monodromy)
    invariants = [np.trace(monodromy), np.linalg.det(monodromy)]
    return [*np.asarray(orbit.state), float(time), float(velocity), *invariants]


def compliant(omega: float, stop: float, damping: float, guess):
    """What is observed with each stiffness, and the durations of contact."""
    seen, contacts = [], []
    for stiffness in STIFFNESSES:
        system = BilinearOscillator(
            stiffness=stiffness, stop=stop, damping=damping, amplitude=1.0, omega=omega
        )
        orbit = continuation.periodic_orbit(system, guess, periods=1)
        switches = orbit.switches
        assert [event.kind for event in orbit.signature] == ["cross"] * 2
        times = np.asarray(switches.time)
        seen.append(observed(orbit, times.mean(), switches.before[0, 1]))
        contacts.append(times[1] - times[0])
    return np.array(seen), np.array(contacts)


def in_the_limit(values):
    """Value at 1 / sqrt(k) = 0 of the polynomial through all values."""
    column = list(values)
    for m in range(1, len(column)):
        column = [
            (SMALL[j] * column[j + 1] - SMALL[j + m] * column[j])
            / (SMALL[j] - SMALL[j + m])
            for j in range(len(column) - 1)
        ]
    return column[0]


@pytest.mark.parametrize("stop", [0.0, -0.2])
def test_a_stiff_stop_becomes_a_rigid_wall(stop):
    """Errors fall by half as the stiffness grows fourfold, to 2 % of the half, and the
    extrapolated orbit and multipliers are those with the wall, to 1e-9.
    """
    rigid = ImpactOscillator(omega=2.2, restitution=1.0, wall=stop, damping=0.1)
    orbit = continuation.periodic_orbit(rigid)
    impacts = orbit.impacts
    assert int(impacts.count) == 1
    exact = np.array(observed(orbit, impacts.time[0], impacts.before[0, 1]))
    seen, contacts = compliant(2.2, stop, 0.1, orbit.state)
    np.testing.assert_allclose(in_the_limit(seen), exact, atol=1e-9)
    np.testing.assert_allclose(in_the_limit(contacts / SMALL), np.pi, atol=1e-9)
    # the determinant is exact for every stiffness: damping acts in contact as well
    np.testing.assert_allclose(seen[:, -1], exact[-1], atol=1e-9)
    errors = (seen - exact)[:, :-1]
    np.testing.assert_allclose(errors[-1] / errors[-2], 0.5, rtol=0.02)


def test_the_undamped_orbit_of_the_rigid_limit_has_a_closed_form():
    """Extrapolated orbit and multipliers, to 1e-9.

    Without damping, the orbit is even in time: x = V cos(omega t) + B cos(t) between
    impacts at t = -pi / omega and pi / omega, where x = 0.
    """
    omega = 2.2
    half, static = np.pi / omega, 1 / (1 - omega**2)
    free = static / np.cos(half)
    start = [static + free, 0.0]
    velocity = -free * np.sin(half)
    assert start[0] < 0 < velocity
    # before and after the impact, the acceleration is that of the force, -1
    impact = np.array([[-1.0, 0.0], [-2.0 / velocity, -1.0]])
    flight = np.array([[np.cos(half), np.sin(half)], [-np.sin(half), np.cos(half)]])
    monodromy = flight @ impact @ flight
    exact = [*start, half, velocity, np.trace(monodromy), 1.0]
    seen, _ = compliant(omega, 0.0, 0.0, jnp.array(start))
    np.testing.assert_allclose(in_the_limit(seen), exact, atol=1e-9)
