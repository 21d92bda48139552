"""A gear that rattles in its backlash: periodic motion in closed form.

The driving gear's displacement is e = a cos(omega t). In flight, the displacement of
the loose gear grows by P(t) + E(t) u in the time t, and its velocity becomes Q(t) +
F(t) u, where u is the velocity at the start: all equations but a^2 = p^2 + q^2 for p =
a cos(omega t1), q = a sin(omega t1) are linear if the times between the impacts are
given. The amplitude then follows from them.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import continuation
import jaxcam
from jaxcam.models import RattlingGear


OMEGA, CLEARANCE, DRAG, DAMPING, RESTITUTION = 1.0, 1.0, 0.1, 0.05, 0.7
PERIOD = 2 * np.pi / OMEGA


def flight(t):
    """P, E, Q and F: `y'' = -DRAG - DAMPING y'`, solved."""
    kept = np.exp(-DAMPING * t)
    reach = (1 - kept) / DAMPING
    return -DRAG * (t - reach) / DAMPING, reach, -DRAG * reach, kept


class Driver:
    """Displacement, velocity and acceleration of the driving gear."""

    def __init__(self, p: float, q: float):
        self.amplitude, self.first = np.hypot(p, q), np.arctan2(q, p) / OMEGA

    def at(self, t):
        return self.amplitude * np.cos(OMEGA * t)

    def velocity(self, t):
        return -self.amplitude * OMEGA * np.sin(OMEGA * t)

    def acceleration(self, t):
        return -self.amplitude * OMEGA**2 * np.cos(OMEGA * t)


def system(amplitude: float) -> RattlingGear:
    return RattlingGear(
        clearance=CLEARANCE,
        drag=DRAG,
        damping=DAMPING,
        amplitude=amplitude,
        omega=OMEGA,
        restitution=RESTITUTION,
    )


def both_flanks(there: float):
    """The driver and the velocities of the loose gear after and before its impacts.

    It takes the time `there` from the driving flank to the opposite one. The unknowns
    are the velocities after the two impacts, the distance covered, p and q.
    """
    back = PERIOD - there
    c, s = np.cos(OMEGA * there), np.sin(OMEGA * there)
    (p1, e1, q1, f1), (p2, e2, q2, f2) = flight(there), flight(back)
    r, gain = RESTITUTION, (1 + RESTITUTION) * OMEGA
    matrix = [
        [-e1, 0, 1, 0, 0],  # the distance is covered on the way there
        [0, -e2, -1, 0, 0],  # and back
        [r * f1, 1, 0, gain * s, gain * c],  # impact on the opposite flank
        [1, r * f2, 0, 0, gain],  # impact on the driving flank
        [0, 0, 1, 1 - c, s],  # distance: backlash and displacement of the driver
    ]
    right = [p1, p2, -r * q1, -r * q2, 2 * CLEARANCE]
    u1, u2, _, p, q = np.linalg.solve(np.array(matrix, dtype=float), right)
    return Driver(p, q), (u1, u2), (q2 + f2 * u2, q1 + f1 * u1)


def impact_to_impact(driver, start, end, leaving, arriving):
    """Derivatives of time and velocity after an impact by those after the last one."""
    _, reach, _, kept = flight(end - start)
    closing = arriving - driver.velocity(end)
    time = np.array([arriving - driver.velocity(start), -reach]) / closing
    slowing = -DRAG - DAMPING * arriving
    velocity = slowing * (time - [1, 0]) + kept * np.array([0, 1])
    push = (1 + RESTITUTION) * driver.acceleration(end)
    return np.array([time, push * time - RESTITUTION * velocity])


def from_flank_to_flank(there: float):
    """Derivative of the motion from one impact on the driving flank to the next one."""
    driver, (u1, u2), (w1, w2) = both_flanks(there)
    start, end = driver.first, driver.first + PERIOD
    forth = impact_to_impact(driver, start, start + there, u1, w2)
    return impact_to_impact(driver, start + there, end, u2, w1) @ forth


def compare(driver, times, leaving, arriving, flanks, guess, start):
    """Phases, velocities and multipliers of the orbit are those expected, to 1e-9."""
    # the start of the orbit is between impacts: the guess is the expected motion there
    orbit = continuation.periodic_orbit(
        system(driver.amplitude), jnp.asarray(guess), periods=1, t0=start
    )
    impacts = orbit.impacts
    assert int(impacts.count) == len(times)
    order = np.argsort(np.asarray(impacts.constraint))
    assert np.asarray(impacts.constraint)[order].tolist() == flanks
    found = np.asarray(impacts.time)[order]
    apart = (found - times + PERIOD / 2) % PERIOD - PERIOD / 2
    np.testing.assert_allclose(apart, 0.0, atol=1e-9)
    driven = driver.velocity(np.asarray(times))
    before = np.asarray(impacts.before)[order, 1]
    after = np.asarray(impacts.after)[order, 1]
    np.testing.assert_allclose(before, driven - arriving, atol=1e-9)
    np.testing.assert_allclose(after, driven - leaving, atol=1e-9)
    return np.sort_complex(np.asarray(orbit.multipliers))


def between(driver, start, behind, leaving, t):
    """State at the time t of a flight that began with a transmission error `behind`."""
    p, e, q, f = flight(t - start)
    y = driver.at(start) - behind + p + e * leaving
    return [driver.at(t) - y, driver.velocity(t) - q - f * leaving]


@pytest.mark.parametrize("there", [1.8, 2.1, 2.6, 3.6])
def test_one_impact_on_each_flank(there):
    """Phases, velocities and multipliers, to 1e-9; the orbit with 2.6 is unstable."""
    driver, (u1, u2), (w1, w2) = both_flanks(there)
    first = driver.first
    times = np.array([first, first + there])
    half = first + there / 2
    guess = between(driver, first, CLEARANCE, u1, half)
    args = (times, np.array([u1, u2]), np.array([w1, w2]), [0, 1])
    found = compare(driver, *args, guess, half)
    expected = np.sort_complex(np.linalg.eigvals(from_flank_to_flank(there)))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert (np.max(np.abs(expected)) > 1) == (there == 2.6)


def test_fold_and_flip_of_the_motion_with_two_impacts():
    """The branch of the default gear turns at the smallest amplitude of all such
    motions and loses its stability where a multiplier is -1, both to 1e-9.
    """
    least = minimize_scalar(
        lambda there: both_flanks(there)[0].amplitude,
        bounds=(2.2, 2.5),
        method="bounded",
        options={"xatol": 1e-9},
    )
    there = brentq(
        lambda there: np.linalg.det(np.eye(2) + from_flank_to_flank(there)), 1.6, 1.8
    )
    gear = system(1.0)
    orbit = continuation.periodic_orbit(gear)
    for direction, kind, amplitude in (
        (-1, "fold", least.fun),
        (1, "flip", both_flanks(there)[0].amplitude),
    ):
        found = continuation.branch(
            gear, orbit, "amplitude", (0.9, 1.15), direction=direction
        )
        (point,) = found.special
        assert point.kind == kind and point.converged
        assert point.parameter == pytest.approx(amplitude, abs=1e-9)


@pytest.mark.parametrize(
    ("amplitude", "slowing", "stable"),
    [(0.11, True, True), (0.11, False, False), (0.3, True, False)],
)
def test_impacts_on_the_driving_flank_only(amplitude, slowing, stable):
    """Phases, velocities and multipliers, to 1e-9.

    The gear returns to the same place after a period, which gives its velocities u and
    w; at the impact, the velocity of the driver is (u + r w) / (1 + r), at two phases:
    while the driver slows down, or not.
    """
    p, e, q, f = flight(PERIOD)
    u = -p / e
    w = q + f * u
    sine = -(u + RESTITUTION * w) / ((1 + RESTITUTION) * amplitude * OMEGA)
    cosine = np.sqrt(1 - sine**2) * (1 if slowing else -1)
    driver = Driver(amplitude * cosine, amplitude * sine)
    first = driver.first
    half = first + PERIOD / 2
    guess = between(driver, first, CLEARANCE, u, half)
    args = (np.array([first]), np.array([u]), np.array([w]), [0])
    found = compare(driver, *args, guess, half)
    expected = np.linalg.eigvals(impact_to_impact(driver, first, first + PERIOD, u, w))
    np.testing.assert_allclose(found, np.sort_complex(expected), atol=1e-9)
    assert (np.max(np.abs(expected)) < 1) == stable


def test_where_rattling_begins():
    """At rest on the driving flank up to the amplitude at which the driver slows down
    as fast as the drag slows the loose gear, not a millionth above it; at a larger
    amplitude, the release is where `e'' + damping e' = -drag`, to 1e-9.
    """
    threshold, excess = DRAG / np.hypot(OMEGA**2, DAMPING * OMEGA), 1.1
    times = (0.5 * PERIOD, 1.4 * PERIOD)
    rests, begins, rattles = (
        jaxcam.simulate(system(size * threshold), [CLEARANCE, 0.0], *times)
        for size in (1 - 1e-9, 1 + 1e-6, excess)
    )
    assert not np.any(np.asarray(rests.contacts.released))
    assert bool(begins.contacts.released[0]) and bool(rattles.contacts.released[0])
    release = np.arctan2(DAMPING, OMEGA) - np.arccos(1 / excess) + 2 * np.pi
    assert float(rattles.contacts.end[0]) * OMEGA == pytest.approx(release, abs=1e-9)
