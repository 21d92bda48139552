"""An oscillator between two stops, and a relief valve."""

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import jaxcam
from jaxcam.models import ReliefValve, TwoSidedStop


def symmetric_orbit(omega: float, clearance: float, restitution: float):
    """Phase and velocity after the impact on the upper stop, without damping.

    The response `A cos(omega t + phase)` and two harmonic functions meet the stops half
    a period apart, with opposite velocities.
    """
    size = 1 / (1 - omega**2)
    c, s = np.cos(np.pi / omega), np.sin(np.pi / omega)
    # p and q: value and slope of the response at the impact, linear in the velocity
    matrix = np.array([[-(1 + c), -s], [s, -(1 + c)]])
    constant = np.linalg.solve(matrix, [-clearance * (1 + c), clearance * s])
    linear = np.linalg.solve(matrix, [-s, 1 / restitution - c])
    weights = np.array([1.0, 1 / omega**2])
    square = [
        weights @ linear**2,
        2 * weights @ (linear * constant),
        weights @ constant**2 - size**2,
    ]
    velocity = min(np.roots(square).real)
    p, q = constant + velocity * linear
    return float(np.arctan2(-q / (size * omega), p / size)), float(velocity)


def test_the_symmetric_orbit_between_two_stops():
    """Impact times and velocities over two periods, to 1e-10 (Shaw 1985)."""
    omega, clearance, restitution = 2.8, 0.1, 0.8
    phase, velocity = symmetric_orbit(omega, clearance, restitution)
    assert velocity < 0
    system = TwoSidedStop(
        omega=jnp.asarray(omega),
        clearance=jnp.asarray(clearance),
        restitution=jnp.asarray(restitution),
    )
    start = (phase % (2 * np.pi)) / omega
    half = np.pi / omega
    run = jaxcam.simulate(system, [clearance, velocity], start, start + 4.5 * half)
    assert run.successful
    count = int(run.impacts.count)
    times = np.asarray(run.impacts.time)[:count] - start
    np.testing.assert_allclose(times, half * np.arange(1, 5), atol=1e-10)
    after = np.asarray(run.impacts.after)[:count, 1]
    np.testing.assert_allclose(after, velocity * np.array([-1, 1, -1, 1]), atol=1e-10)


def test_the_hopf_point_of_the_relief_valve():
    """Two eigenvalues cross the imaginary axis where the Hurwitz condition says."""

    def jacobian(lift):
        valve = ReliefValve(flow=jnp.asarray(lift * np.sqrt(lift + 10.0)))
        at = jnp.array([lift, 0.0, lift + 10.0])
        field = valve.vector_field(0.0, at)
        np.testing.assert_allclose(field, 0, atol=1e-12)
        return np.asarray(jax.jacfwd(lambda y: valve.vector_field(0.0, y))(at))

    def hurwitz(lift):
        pressure = lift + 10.0
        a, b = 10.0 * lift / np.sqrt(pressure), 20.0 * np.sqrt(pressure)
        return (1.25 + a) * (1 + 1.25 * a) - (a + b)

    lift = brentq(hurwitz, 0.5, 10.0)
    values = np.linalg.eigvals(jacobian(lift))
    pair = values[np.abs(values.imag) > 0.1]
    np.testing.assert_allclose(pair.real, 0.0, atol=1e-12)
    below = np.linalg.eigvals(jacobian(0.99 * lift))
    assert np.max(below.real) > 0


def test_impacts_of_the_relief_valve():
    """Ten impact times against DOP853 with events, to 1e-9."""
    valve = ReliefValve(flow=jnp.asarray(3.0))
    start = [0.5, 0.0, 11.0]
    run = jaxcam.simulate(valve, start, 0.0, 18.0)
    assert run.successful
    count = int(run.impacts.count)
    assert count >= 10

    def field(_, y):
        x, v, p = y
        return [v, p - 10.0 - x - 1.25 * v, 20.0 * (3.0 - x * np.sqrt(p))]

    def seat(_, y):
        return y[0]

    seat.terminal, seat.direction = True, -1  # pyright: ignore
    t, y, times = 0.0, np.array(start), []
    while len(times) < 10:
        part = solve_ivp(
            field, (t, 18.0), y, "DOP853", events=seat, rtol=1e-12, atol=1e-14
        )
        t, y = float(part.t[-1]), part.y[:, -1]
        times.append(t)
        y = np.array([0.0, -0.8 * y[1], y[2]])
    np.testing.assert_allclose(np.asarray(run.impacts.time)[:10], times, atol=1e-9)
