"""What docs/errata.md says about printed formulas, recomputed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from jaxcam.hybrid.surface import normal_acceleration
from jaxcam.models import CamFollower, EccentricCircle


# x'' + x = cos(w t), x <= sigma, restitution r: (6.1)
W, R, SIGMA = 2.8, 0.8, 0.1
GAMMA = 1 / (1 - W * W)


def _after_impact(phi, v, forced):
    """(6.5) and its velocity, with the forcing's phase given as a function."""
    a = SIGMA - GAMMA * np.cos(W * phi)
    b = -R * v + GAMMA * W * np.sin(W * phi)

    def position(t):
        free = a * np.cos(t - phi) + b * np.sin(t - phi)
        return GAMMA * np.cos(W * forced(t, phi)) + free

    def velocity(t):
        free = -a * np.sin(t - phi) + b * np.cos(t - phi)
        return -GAMMA * W * np.sin(W * forced(t, phi)) + free

    return position, velocity


def _absolute(t, phi):
    return t


def _next_impact(phi, v):
    position, velocity = _after_impact(phi, v, _absolute)
    times = np.linspace(phi + 1e-3, phi + 10, 10_000)
    k = np.argmax(position(times) > SIGMA)
    t = brentq(lambda s: position(s) - SIGMA, times[k - 1], times[k], xtol=1e-15)
    return t, velocity(t)


def test_contact_geometry():
    cam = EccentricCircle()
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    contact = np.asarray(cam(jnp.asarray(angle)))

    def height(first):
        x = float(cam.eccentricity) * first + float(cam.center_x)
        y = float(cam.eccentricity) * np.sin(angle) + float(cam.center_y)
        reach = float(cam.half_height + cam.radius)
        return x * np.sin(contact) - y * np.cos(contact) - reach

    assert_allclose(height(np.cos(angle)), 0, atol=1e-15)
    assert np.abs(height(np.sin(angle))).max() > 1e-3


def test_relative_acceleration_of_the_follower():
    system = CamFollower()
    t, state = jnp.asarray(0.05), jnp.array([0.3, 0.0])
    free = system.vector_field(t, state)[1]
    cam = jax.grad(jax.grad(lambda s: system.contact_angle(system.cam_angle(s))))(t)
    assert_allclose(normal_acceleration(system, t, state)[0], free - cam, rtol=1e-12)
    assert abs(cam) > 1


def test_motion_after_an_impact():
    start = 0.3
    position, velocity = _after_impact(start, 0.7, _absolute)
    assert_allclose(position(start), SIGMA, atol=1e-15)
    assert_allclose(velocity(start), -R * 0.7, atol=1e-15)
    printed, _ = _after_impact(start, 0.7, lambda t, phi: t - phi)
    assert abs(printed(start) - SIGMA) > 0.01


def test_derivative_of_the_impact_phase():
    phi, v, e = 0.3, 0.7, 1e-6
    t, speed = _next_impact(phi, v)
    moved = _next_impact(phi + e, v)[0] - _next_impact(phi - e, v)[0]
    ahead, _ = _after_impact(phi + e, v, _absolute)
    behind, _ = _after_impact(phi - e, v, _absolute)
    partial = (ahead(t) - behind(t)) / (2 * e)
    assert_allclose(moved / (2 * e), -partial / speed, rtol=1e-6)


@pytest.mark.parametrize("acceleration", [-1.0, -0.3])
def test_first_return_is_the_smaller_root(acceleration):
    lam = 0.1
    v = lam * acceleration**2
    roots = np.sort(np.roots([1 / 6, acceleration / 2, v]))
    root = 3 * np.sqrt((acceleration / 2) ** 2 - 2 * v / 3)
    s = np.sqrt(1 - 8 * lam / 3)
    assert_allclose(-3 * acceleration / 2 - root, roots[0])
    assert_allclose(-3 * acceleration / 2 + root, roots[1])  # (6.27) as printed
    assert_allclose(1.5 * acceleration * (s - 1), roots[0])  # (6.29) as printed


def test_relative_motion_above_a_moving_floor():
    w, sigma, t0, y0, v0 = 1.7, 0.1, 0.4, 0.2, 0.5

    def field(t, y):
        return [y[1], -y[0] + (w * w - 1) * np.sin(w * t) - sigma]

    solution = solve_ivp(field, (t0, t0 + 1), [y0, v0], rtol=1e-12, atol=1e-12)
    true = solution.y[0, -1]

    def closed(phase):
        position = y0 + np.sin(phase) + sigma
        velocity = v0 + w * np.cos(phase)
        free = position * np.cos(1.0) + velocity * np.sin(1.0)
        return free - np.sin(w + phase) - sigma

    assert_allclose(closed(w * t0), true, atol=1e-9)
    assert abs(closed(0.0) - true) > 0.1  # (6.70) as printed


def test_slope_of_the_scalar_chatter_map_passes_one_below_its_fixed_point():
    r = 0.6

    def step(lam):
        s = jnp.sqrt(1 - 8 * lam / 3)
        return 3 * r * s * (1 - s) / (3 * s - 1) ** 2

    # f(s) = lambda(s): a cubic in s, of which one root lies in (1/3, 1)
    roots = np.roots([9, 3, -(5 + 8 * r), 1]).real
    s = roots[(roots > 1 / 3 + 1e-9) & (roots < 1 - 1e-9)]
    fixed = 3 * (1 - s[0] ** 2) / 8
    assert_allclose(step(fixed), fixed, rtol=1e-12)
    slope = jax.grad(step)
    assert slope(1e-9) < 1 < slope(fixed)
    assert_allclose(slope(fixed), (1 + s[0]) ** 2 / (2 * s[0] ** 2 * (3 * s[0] - 1)))


def test_period_doubling_needs_a_multiplier_of_minus_one():
    printed = jax.grad(lambda x, mu: (1 + mu) * x - x**3)
    assert printed(0.0, 0.0) == 1.0


def test_forcing_on_the_cylinder():
    """(2.5) as printed has the forcing of (2.4) for omega = 1 only."""
    for omega in (1.0, W):
        t = np.linspace(0, 4 * np.pi, 501)
        phase = np.mod(t, 2 * np.pi / omega)
        assert_allclose(np.cos(omega * phase), np.cos(omega * t), atol=1e-12)
        off = np.max(np.abs(np.cos(phase) - np.cos(omega * t)))
        assert off < 1e-12 if omega == 1 else off > 0.5
