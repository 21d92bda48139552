"""Where complete chattering ends, against motions that are resolved hop by hop.

The flights of the oscillator are closed forms evaluated with 40 digits; those of the
cam-follower are integrated by scipy in the coordinate relative to the cam.
"""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from oscillator_hops import completes, oscillator_hop
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from jaxcam.models import (
    CamFollower,
    ImpactOscillator,
    preset,
    rad_s_to_rpm,
    rpm_to_rad_s,
)
from variational import (
    adding_thresholds,
    chatter_accumulation,
    chatter_frame,
    chatter_interruption,
    impact_jacobian,
    impact_map,
    scaling_law,
)
from variational.chatter import interruption_margin


def omega(system):
    return system.omega


BRACKETS = {0.3: (0.7, 1.2), 0.4: (0.6, 1.0), 0.5: (0.4, 0.8), 0.7: (0.3, 0.5)}


def found(r):
    oscillator = ImpactOscillator(omega=jnp.asarray(1.0), restitution=jnp.asarray(r))
    return chatter_interruption(oscillator, omega, BRACKETS[r])


@pytest.mark.parametrize("r", [0.3, 0.5, 0.7])
def test_oscillator_interruption_to_1e_10(r):
    w = float(found(r))
    assert completes(w * (1 - 1e-10), r)
    assert not completes(w * (1 + 1e-10), r)


@pytest.mark.parametrize("r", [0.3, 0.4, 0.5, 0.7])
def test_six_impact_adding_thresholds_approach_by_q(r):
    w = found(r)
    oscillator = ImpactOscillator(omega=jnp.asarray(1.0), restitution=jnp.asarray(r))
    # six thresholds, close enough to be in the range of the law
    values = np.asarray(adding_thresholds(oscillator, omega, w, w * (1 + 1e-7), 6))
    steps = np.diff(values)
    ratio = steps[:-1] / steps[1:]
    assert abs(ratio[-1] * float(scaling_law(r).q) - 1) < 5e-4


def test_interruption_is_differentiable():
    def value(r):
        oscillator = ImpactOscillator(omega=jnp.asarray(1.0), restitution=r)
        return chatter_interruption(oscillator, omega, (0.4, 0.8))

    _, rate = jax.jvp(value, (jnp.asarray(0.5),), (jnp.asarray(1.0),))
    h = 1e-5
    ends = [float(value(jnp.asarray(0.5 + k * h))) for k in (-1, 1)]
    assert abs(float(rate) / ((ends[1] - ends[0]) / (2 * h)) - 1) < 1e-8


def sticks_in_the_second_period(w, r):
    """Whether the orbit from release chatters to rest in the second period, not before.

    Flights in closed form, the next impact by a scan and bisection.
    """
    g, period, bar = 1 / (1 - w * w), 2 * np.pi / w, float(scaling_law(r).lambda_bar)
    release = np.pi / 2 / w
    t, u = release, 0.0
    for _ in range(400):
        a, b = -g * np.cos(w * t), -u + g * w * np.sin(w * t)

        def position(s, t=t, a=a, b=b):
            # of the forced and the free part, without their cancelling at s = 0
            d = w * s
            forced = np.cos(w * t) * (np.cos(d) - 1) - np.sin(w * t) * np.sin(d)
            return g * forced + a * (np.cos(s) - 1) + b * np.sin(s)

        grid = np.geomspace(1e-7, 2 * period, 20000)
        hit = int(np.argmax(position(grid) > 0))
        s = brentq(position, grid[hit - 1], grid[hit], xtol=1e-16)
        v = -g * w * np.sin(w * (t + s)) - a * np.sin(s) + b * np.cos(s)
        t, u = t + s, r * v
        turn = int((t - release) // period) + 1
        end = release + turn * period
        close = 1e-4 < (end - t) * w < 3e-2
        lam = u / (w * (t - end) ** 2)
        if turn > 2:
            return False
        if close and lam < bar / 2:
            return turn == 2
    raise AssertionError("neither in 400 impacts")


@pytest.mark.parametrize("low, high", [(2.96, 2.99), (3.19, 3.24)])
def test_orbit_that_sticks_every_second_period(low, high):
    r = 0.3
    oscillator = ImpactOscillator(omega=jnp.asarray(3.1), restitution=jnp.asarray(r))
    w = float(chatter_interruption(oscillator, omega, (low, high), periods=2))
    inwards = 1.0 if low < 3 else -1.0
    assert sticks_in_the_second_period(w * (1 + 1e-7 * inwards), r)
    assert not sticks_in_the_second_period(w * (1 - 1e-7 * inwards), r)


def test_a_bracket_without_interruption_is_refused():
    oscillator = ImpactOscillator(omega=jnp.asarray(1.0), restitution=jnp.asarray(0.5))
    with pytest.raises(ValueError, match="interrupted, or does not occur, at both"):
        chatter_interruption(oscillator, omega, (0.7, 0.8))
    with pytest.raises(ValueError, match="complete at both ends"):
        chatter_interruption(oscillator, omega, (0.4, 0.5))


def test_accumulation_of_complete_chattering():
    r, w = 0.5, 0.45
    orbit = jax.jit(chatter_accumulation)(
        ImpactOscillator(omega=jnp.asarray(w), restitution=jnp.asarray(r))
    )
    with mpmath.workdps(40):
        t, u = mpmath.pi / 2 / mpmath.mpf(w), mpmath.mpf(0)
        assert abs(float(orbit.frame.release - float(t))) < 1e-14
        while u == 0 or u > mpmath.mpf(10) ** -22:
            t, v = oscillator_hop(mpmath.mpf(w), t, u)
            u = r * v
        # what is left is below rounding
        assert abs(float(t) - float(orbit.accumulation)) < 1e-11
    assert bool(orbit.complete)
    assert float(orbit.margin) < 0


def test_the_quick_margin_refuses_a_second_derivative():
    """Its landings are right to first order only; silence would be a wrong number."""

    def margin(w):
        system = ImpactOscillator(omega=w, restitution=jnp.asarray(0.5)).prepared()
        return interruption_margin(system, chatter_frame(system))

    # as they are traced: nothing is compiled
    once = jax.eval_shape(jax.jacfwd(margin), jnp.asarray(0.6))
    assert once.shape == ()
    with pytest.raises(ValueError, match="differentiated only once"):
        jax.eval_shape(jax.jacfwd(jax.jacfwd(margin)), jnp.asarray(0.6))


@pytest.mark.parametrize("time, speed", [(-0.5, 1e-10), (-0.3, 0.05), (0.5, 1e-4)])
def test_impact_map_to_rounding(time, speed):
    w, r = 2.8, 0.5
    oscillator = ImpactOscillator(omega=jnp.asarray(w), restitution=jnp.asarray(r))
    t, u = jnp.asarray(time), jnp.asarray(speed)
    at, after = jax.jit(impact_map)(oscillator, t, u)
    with mpmath.workdps(40):
        s, v = oscillator_hop(mpmath.mpf(w), mpmath.mpf(time), mpmath.mpf(speed))
        assert abs(float(s - mpmath.mpf(float(at)))) < 1e-14
        assert abs(float(r * v / mpmath.mpf(float(after))) - 1) < 1e-12
    # (6.11) with free flight that keeps volume
    determinant = float(jnp.linalg.det(jax.jit(impact_jacobian)(oscillator, t, u)))
    assert abs(determinant / (r * r * speed / float(after)) - 1) < 1e-7


# ---- the cam-follower, Table 4.4, without the project's integrator -------------------

RADIUS, ECCENTRICITY, AXIS, HALF = 0.045, 0.015, 0.249, 0.021
INERTIA, STIFFNESS, HOOK, STRETCH = 0.043, 105.0, -0.031, 0.173


def contact_slope(angle):
    """d(contact angle)/d(cam angle); takes complex angles."""
    e, x0, h = ECCENTRICITY, AXIS, RADIUS + HALF
    square = e * e + x0 * x0 + 2 * e * x0 * np.cos(angle)
    turn = (e * e + e * x0 * np.cos(angle)) / square
    return turn + h * e * x0 * np.sin(angle) / (square * np.sqrt(square - h * h))


def contact_angle(angle):
    x = ECCENTRICITY * np.cos(angle) + AXIS
    y = ECCENTRICITY * np.sin(angle)
    return np.arcsin((RADIUS + HALF) / np.hypot(x, y)) + np.arctan2(y, x)


def relative_acceleration(omega, sense, t, angle):
    cam = sense * omega * t
    # second derivative by a complex step: no subtraction
    second = np.imag(contact_slope(cam + 1e-30j)) / 1e-30
    reach = HOOK * np.tan(angle) + HALF / np.cos(angle) - STRETCH
    arm = (HOOK + HALF * np.sin(angle)) / np.cos(angle) ** 2
    return -STIFFNESS / INERTIA * reach * arm - omega**2 * second


def cam_flight(omega, sense, t, u, duration):
    """Gap and relative velocity after a flight off the cam with rebound speed u."""

    def field(s, y):
        angle = contact_angle(sense * omega * (t + s)) + y[0]
        return [y[1], relative_acceleration(omega, sense, t + s, angle)]

    # the scale of the flight itself: rounding leaves no more
    size = u if u > 0 else duration
    end = solve_ivp(
        field,
        (0, duration),
        [0.0, u],
        method="DOP853",
        rtol=1e-12,
        atol=[1e-13 * size * duration, 1e-13 * size],
    )
    return end.y[:, -1]


def cam_completes(rpm, rotation):
    sense = -1.0 if rotation == "clockwise" else 1.0
    w = rpm * np.pi / 30
    r = 0.00795658 * rpm - 0.62122908
    period = 2 * np.pi / w

    def push(t):
        angle = contact_angle(sense * w * t)
        return relative_acceleration(w, sense, t, angle)

    grid = np.linspace(0, period, 721)
    values = np.array([push(t) for t in grid])
    peak = int(np.argmax(values))
    low = peak
    while values[low % 720] > 0:
        low -= 1
    step = grid[1]
    release = brentq(push, low * step, (low + 1) * step, xtol=1e-16, rtol=1e-15)
    h = 1e-6
    jerk = (push(release + h) - push(release - h)) / (2 * h)
    end, t, u = release + period, release, 0.0
    bar = float(scaling_law(r).lambda_bar)
    for count in range(60):
        if count == 0:
            spans = np.linspace(0.02, period, 30)
            gaps = [cam_flight(w, sense, t, u, s)[0] for s in spans]
            k = int(np.argmax(np.array(gaps) < 0))
            s = 0.5 * (spans[k - 1] + spans[k])
        else:
            tau = t - end
            lam = u / (jerk * tau * tau)
            if abs(tau) < 0.02 * period and lam < bar / 2:
                return True
            if lam > 3 / 8:
                return False
            s = 1.5 * tau * (np.sqrt(1 - 8 * lam / 3) - 1)
        for _ in range(8):
            gap, velocity = cam_flight(w, sense, t, u, s)
            change = gap / velocity
            s -= change
            if abs(change) < 1e-13 * s:
                break
        t, u = t + s, -r * velocity
        if t >= end:
            return False
    raise AssertionError("neither in 60 impacts")


@pytest.mark.slow
@pytest.mark.parametrize("rotation", ["clockwise", "counterclockwise"])
def test_cam_follower_interruption_to_1e_8_rpm(rotation):
    cam = CamFollower(speed=rpm_to_rad_s(jnp.asarray(150.0)), rotation=rotation)
    bracket = (rpm_to_rad_s(146.0), rpm_to_rad_s(156.0))
    value = chatter_interruption(cam, lambda s: s.speed, bracket)
    rpm = float(rad_s_to_rpm(value))
    assert cam_completes(rpm - 1e-8, rotation)
    assert not cam_completes(rpm + 1e-8, rotation)


def test_calibrated_rig_is_interrupted_where_the_thesis_says():
    bracket = (rpm_to_rad_s(150.0), rpm_to_rad_s(154.0))
    value = chatter_interruption(preset("calibrated"), lambda s: s.speed, bracket)
    # the tables it was recovered from have five digits; facts of section 6.7.1
    assert abs(float(rad_s_to_rpm(value)) - 152.67658) < 0.002
