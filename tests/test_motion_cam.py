"""The cam-follower of Table 4.4 against its geometry, integrated independently."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from jaxcam import simulate
from jaxcam.hybrid.surface import contact_acceleration, contact_state
from jaxcam.models import CamFollower, rpm_to_rad_s


# Table 4.4, and the restitution that Table 5.2 implies (per rpm, and at zero)
RADIUS, ECCENTRICITY, AXIS, HALF = 0.045, 0.015, 0.249, 0.021
INERTIA, STIFFNESS, HOOK, ELONGATION = 0.043, 105.0, -0.031, 0.173
SLOPE, INTERCEPT = 0.00795658, -0.62122908
HARMONICS = np.arange(1, 30)


def _spectrum():
    """Fourier coefficients of the contact angle (4.23), so that it has derivatives."""
    angle = 2 * np.pi * np.arange(256) / 256
    x, y = ECCENTRICITY * np.cos(angle) + AXIS, ECCENTRICITY * np.sin(angle)
    contact = np.arcsin((RADIUS + HALF) / np.hypot(x, y)) + np.arctan2(y, x)
    coefficients = np.fft.rfft(contact) / 256
    return coefficients[0].real, 2 * coefficients[1:30]


MEAN, COEFFICIENTS = _spectrum()


def contact_angle(cam, order=0):
    """Contact angle at a cam angle (counterclockwise), or a derivative of it."""
    waves = np.exp(1j * np.multiply.outer(cam, HARMONICS)) * (1j * HARMONICS) ** order
    return (waves @ COEFFICIENTS).real + (MEAN if order == 0 else 0.0)


def free_acceleration(angle):
    """Acceleration of the follower under its spring: (4.9) by hand."""
    sine, cosine = np.sin(angle), np.cos(angle)
    stretch = (HOOK * sine + HALF) / cosine - ELONGATION
    return -STIFFNESS / INERTIA * stretch * (HOOK + HALF * sine) / cosine**2


def suppressed(cam, omega):
    """Acceleration of the gap that contact suppresses; it holds where this is < 0."""
    return free_acceleration(contact_angle(cam)) - omega**2 * contact_angle(cam, 2)


def lost_and_found(omega, r):
    """Phases of one turn that starts at the release: times (s) after cam angle zero.

    The flights are integrated with DOP853; the rest of the chatter, once its hops are
    lower than rounding can tell, is summed to second order.
    """
    grid = np.linspace(0.0, 2 * np.pi, 2001)
    values = suppressed(-grid, omega)
    (rises,) = np.nonzero((values[:-1] < 0) & (values[1:] >= 0))
    assert len(rises) == 1
    phase = brentq(
        lambda p: suppressed(-p, omega), grid[rises[0]], grid[rises[0] + 1], xtol=1e-15
    )
    t = release = phase / omega

    def gap(s, x):
        return x[0] - contact_angle(-omega * s)

    state = np.array([contact_angle(-phase), -omega * contact_angle(-phase, 1)])
    impacts, speed = [], np.inf
    while speed > 1e-4:
        # from release the gap opens with its jerk, later with its velocity
        ahead = t + 1.5 * 2 * np.pi / omega
        flight = solve_ivp(
            lambda s, x: [x[1], free_acceleration(x[0])],
            (t, ahead),
            state,
            method="DOP853",
            dense_output=True,
            rtol=1e-13,
            atol=1e-14,
            max_step=0.01,
        ).sol
        bend = suppressed(-omega * t, omega)
        first = 1e-3 if speed == np.inf else speed / abs(bend)
        low = t + first
        high = low
        while gap(high, flight(high)) > 0:
            low, high = high, high + first
        t = brentq(lambda s: gap(s, flight(s)), low, high, xtol=1e-15, rtol=1e-15)
        wall = -omega * contact_angle(-omega * t, 1)
        velocity = flight(t)[1] - wall
        speed = -r * velocity
        state = np.array([contact_angle(-omega * t), wall + speed])
        impacts.append(t)
    a = suppressed(-omega * t, omega)
    rate = (
        suppressed(-omega * (t + 1e-5), omega) - suppressed(-omega * (t - 1e-5), omega)
    ) / 2e-5
    rest = -2 * speed / (a * (1 - r))
    rest -= 4 / 3 * rate * speed**2 / (a**3 * (1 - r) ** 2)
    return release, np.array(impacts), t + rest


def cam(rpm):
    return CamFollower(speed=rpm_to_rad_s(rpm))


# --- contact


def test_range_of_the_contact_angle():
    system = cam(100.0)
    times = jnp.linspace(0.0, 1.0, 4001) * system.period
    angles = np.asarray(contact_state(system, times, jnp.array([0.3, 0.0])))[:, 0]
    # rad
    assert abs(angles.min() - 0.20628) < 5e-6
    assert abs(angles.max() - 0.33133) < 5e-6
    exact = contact_angle(-np.asarray(system.speed * times))
    assert np.max(np.abs(angles - exact)) < 1e-13


def test_detachment_speed():
    share = jnp.linspace(0.0, 1.0, 4001)

    @jax.jit
    def largest(rpm):
        system = cam(rpm)
        pulled = contact_acceleration(
            system, share * system.period, jnp.array([0.3, 0.0])
        )
        return jnp.max(pulled)

    found = brentq(lambda rpm: float(largest(rpm)), 115.0, 130.0, xtol=1e-10)
    assert abs(found - 122.454) < 1e-3  # rpm
    phases = np.linspace(0.0, 2 * np.pi, 4001)
    exact = brentq(
        lambda rpm: np.max(suppressed(-phases, rpm_to_rad_s(rpm))), 115.0, 130.0
    )
    assert abs(found - exact) < 1e-8  # rpm


def test_contact_is_permanent_at_120_rpm():
    system = cam(120.0)
    t1 = 20 * float(system.period)
    trajectory = simulate(system, None, 0.0, t1)
    assert trajectory.result == ""
    assert int(trajectory.impacts.count) == 0
    contacts = trajectory.contacts
    assert int(contacts.count) == 1
    assert float(contacts.start[0]) == 0.0
    assert float(contacts.end[0]) == t1
    assert not bool(contacts.released[0])
    times = np.linspace(0.0, t1, 500)
    cam_angle = -float(system.speed) * times
    states = np.asarray(trajectory.at(times))
    assert np.max(np.abs(states[:, 0] - contact_angle(cam_angle))) < 1e-12  # rad
    velocity = -float(system.speed) * contact_angle(cam_angle, 1)
    assert np.max(np.abs(states[:, 1] - velocity)) < 1e-11  # rad/s


# --- complete chattering, once a turn


@pytest.fixture(scope="module")
def chattering():
    system = cam(140.0)
    return simulate(system, None, 0.0, 6 * float(system.period), tolerance=1e-12)


@pytest.fixture(scope="module")
def oracle():
    return lost_and_found(140.0 * 2 * np.pi / 60, SLOPE * 140.0 + INTERCEPT)


def test_chattering_orbit_repeats_every_turn(chattering):
    period = float(chattering.system.period)
    assert chattering.result == ""
    contacts = chattering.contacts
    ends = np.asarray(contacts.end[contacts.released])
    # the first contact is cut short by the start of the run
    starts = np.asarray(contacts.start)[1:]
    assert len(ends) == 6 and len(starts) == 5
    assert np.max(np.abs(np.diff(ends) - period)) < 1e-10  # s
    assert np.max(np.abs(np.diff(starts) - period)) < 1e-10  # s
    later = np.asarray(chattering.stroboscopic())[1:]
    assert np.max(np.abs(later - later[0])) < 1e-9


def test_sticking_interval_is_that_of_an_independent_integration(chattering, oracle):
    period = float(chattering.system.period)
    release, impacts, rest = oracle
    assert 10 < len(impacts) < 40
    contacts = chattering.contacts
    ends = np.asarray(contacts.end[contacts.released])
    starts = np.asarray(contacts.start)[1:]

    def turns(times, first):
        return (np.asarray(times) - first) / period

    off = turns(ends, release)
    assert np.max(np.abs(off - np.round(off))) * period < 1e-10  # s
    on = turns(starts, rest)
    assert np.max(np.abs(on - np.round(on))) * period < 1e-9  # s
    # it sticks for part of the turn, and lets go before the next one
    assert 0 < (release + period - rest) / period < 0.5
    # impacts after the second release
    origin = ends[1] - release
    hits = np.asarray(chattering.impacts.time)
    hits = hits[hits > ends[1]][: len(impacts)]
    assert np.max(np.abs(hits - origin - impacts)) < 1e-9  # s


# --- one motion, whatever the batch and the tolerance


TURNS, ROWS, HITS = 5, 2048, 400
SPEEDS = (105.0, 120.0, 126.0, 133.0, 137.0, 140.0, 146.0, 149.0)


def events(speed, lift, tolerance):
    """Impacts and contacts of the orbit dropped from a height, of fixed shape."""
    system = CamFollower(speed=speed)
    start = system.contact_angle(system.cam_angle(0.0)) + lift
    trajectory = simulate(
        system,
        jnp.stack([start, jnp.zeros_like(start)]),
        0.0,
        TURNS * system.period,
        tolerance=tolerance,
        max_steps=ROWS,
    )
    impacts, contacts = trajectory.impacts, trajectory.contacts
    return {
        "code": trajectory.code,
        "impacts": impacts.time[:HITS],
        "hits": impacts.count,
        "on": contacts.start[:20],
        "off": contacts.end[:20],
        "contacts": contacts.count,
    }


batch = jax.jit(jax.vmap(events, in_axes=(0, 0, None)))
SPEED = jnp.asarray(rpm_to_rad_s(np.array(SPEEDS)))
LIFT = jnp.linspace(0.01, 0.05, len(SPEEDS))


def assert_same_events(a, b, lane, atol):
    for name in ("code", "hits", "contacts"):
        assert int(a[name]) == int(b[name]), (name, lane)
    assert int(a["code"]) == 0
    for name, count in (("impacts", "hits"), ("on", "contacts"), ("off", "contacts")):
        number = int(a[count])
        assert number <= a[name].shape[0]
        left, right = np.asarray(a[name])[:number], np.asarray(b[name])[:number]
        assert np.max(np.abs(left - right), initial=0.0) < atol, (name, lane)


def lane(tree, k):
    return jax.tree.map(lambda leaf: leaf[k], tree)


@pytest.fixture(scope="module")
def reference():
    return batch(SPEED, LIFT, jnp.asarray(1e-12))


@pytest.mark.slow
def test_events_do_not_depend_on_the_batch(reference):
    assert len({int(c) for c in reference["hits"]}) > 4  # lanes differ
    three = batch(SPEED[2:5], LIFT[2:5], jnp.asarray(1e-12))
    one = batch(SPEED[6:7], LIFT[6:7], jnp.asarray(1e-12))
    for k in range(3):
        assert_same_events(lane(reference, 2 + k), lane(three, k), 2 + k, 1e-9)
    assert_same_events(lane(reference, 6), lane(one, 0), 6, 1e-9)


@pytest.mark.parametrize("tolerance", [1e-10, 1e-8])
def test_events_do_not_depend_on_the_tolerance(reference, tolerance):
    coarse = batch(SPEED, LIFT, jnp.asarray(tolerance))
    for k in range(len(SPEEDS)):
        assert_same_events(lane(reference, k), lane(coarse, k), k, 1e3 * tolerance)


def test_impacts_and_contacts_alternate_as_they_must(reference):
    for k in range(len(SPEEDS)):
        one = lane(reference, k)
        hits = np.asarray(one["impacts"])[: int(one["hits"])]
        on = np.asarray(one["on"])[: int(one["contacts"])]
        off = np.asarray(one["off"])[: int(one["contacts"])]
        assert np.all(np.diff(hits) > 0)
        assert np.all(off >= on)
        assert np.all(on[1:] > off[:-1])
        # no impact while it sticks
        assert not np.any((hits[:, None] > on) & (hits[:, None] < off))
