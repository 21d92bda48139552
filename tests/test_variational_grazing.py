"""The square-root map of a grazing orbit against closed forms and the flow."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from textbook_systems import parameters

import variational
from jaxcam.hybrid import flow
from jaxcam.models import ImpactOscillator


def steady(omega, damping):
    """Amplitude of the motion without a wall, and its phase."""
    gain = 1 / (1 - omega**2 + 2j * damping * omega)
    return abs(gain), -np.angle(gain)


@eqx.filter_jit
def _end(system, state, t0, t1):
    return flow(system, state, t0, t1)


def _system(omega, damping, wall, r=0.8):
    return ImpactOscillator(
        **parameters(omega=omega, restitution=r, wall=wall, damping=damping)
    )


def _form(omega, damping):
    amplitude, phase = steady(omega, damping)
    system = _system(omega, damping, amplitude + 1e-3)
    start = [amplitude * np.cos(phase), amplitude * omega * np.sin(phase)]
    orbit = variational.orbit_of(system, start)
    return variational.grazing_form(system, orbit, lambda s: s.wall), phase


def test_coefficients_of_the_damped_oscillator():
    omega, damping, r = 2.8, 0.1, 0.8
    amplitude, phase = steady(omega, damping)
    form, _ = _form(omega, damping)
    pulled = omega**2 * amplitude
    kick = (1 + r) * np.sqrt(2 * pulled)
    assert abs(float(form.time) - phase / omega) < 1e-10
    assert abs(float(form.clearance) - 1e-3) < 1e-11
    assert abs(float(form.acceleration) - pulled) < 1e-10
    np.testing.assert_allclose(form.zero_time, [0.0, -kick], atol=1e-10)
    # on the section v = 0, of a system at rest there, nothing of it is left but time
    np.testing.assert_allclose(form.section, [0.0, 0.0], atol=1e-9)
    generator = np.array([[0, 1], [-1, -2 * damping]])
    matrix = expm(generator * 2 * np.pi / omega)
    np.testing.assert_allclose(form.matrix, matrix, atol=1e-11)
    assert abs(float(form.coefficient) - matrix[0, 1] * kick) < 1e-9
    np.testing.assert_allclose(form.normal_parameters, [1.0], atol=1e-14)


def test_the_map_is_the_flow_to_leading_order():
    """Wall moved in by d from the graze; error of relative order sqrt(d)."""
    omega, damping = 2.8, 0.1
    amplitude, phase = steady(omega, damping)
    form, _ = _form(omega, damping)
    half = np.pi / omega
    generator = np.array([[0, 1], [-1, -2 * damping]])
    t0 = float(form.time) + half
    opposite = np.array(
        [
            amplitude * np.cos(omega * t0 - phase),
            -amplitude * omega * np.sin(omega * t0 - phase),
        ]
    )
    misses = []
    for d in (1e-4, 1e-6):
        arrival = _end(
            _system(omega, damping, amplitude - d),
            jnp.asarray(opposite),
            jnp.asarray(t0),
            jnp.asarray(t0 + 2 * half),
        )
        assert int(arrival.impacts) == 1
        moved = np.asarray(arrival.state) - opposite
        mu = jnp.array([-(1e-3 + d)])
        jump = np.asarray(form.discontinuity(jnp.zeros(2), mu))
        predicted = expm(generator * half) @ jump
        misses.append(np.abs(moved - predicted).max() / np.abs(moved).max())
    assert misses[0] < 0.05
    # a hundred times less deep, ten times closer
    assert 8 < misses[0] / misses[1] < 12


def test_windows_of_nordmarks_map():
    """The orbit with one impact in m turns is stable inside the window only."""
    lam = 0.3
    for m in (2, 3):
        low, high = variational.nordmark_window(lam, m)
        for mu, inside in ((0.9 * low, False), (np.sqrt(low * high), True)):
            x, orbit = 0.5 * mu, []
            for _ in range(3000):
                x = float(np.sqrt(mu - x) + lam * mu if x <= mu else lam * x)
                orbit.append(x)
            last = np.array(orbit[-12 * m :])
            repeats = np.abs(last[m:] - last[:-m]).max() < 1e-8
            hits = np.sum(last[:m] <= mu)
            assert (repeats and hits == 1) == inside
    point = variational.nordmark_map(jnp.array([0.1, 0.5]), 0.2, lam)
    np.testing.assert_allclose(point, [np.sqrt(0.1) + 0.06, 0.15], atol=1e-15)
    with pytest.raises(ValueError, match="0 < lam < 1"):
        variational.nordmark_window(1.5, 2)


def test_predicted_windows_are_those_of_the_flow():
    """Overdamped oscillator: one impact in m turns where Nordmark's map says so."""
    omega, damping = 2.0, 1.2
    amplitude, phase = steady(omega, damping)
    form, _ = _form(omega, damping)
    lam = np.asarray(form.multipliers).real
    assert 0 < lam[1] < 0.05 * lam[0] < 1
    assert float(form.coefficient) > 0
    for m in (3, 4):
        low, high = variational.nordmark_window(float(lam[0]), m)
        depth = np.sqrt(low * high) * float(form.coefficient) ** 2
        mu = jnp.array([-(1e-3 + depth)])
        found = float(form.penetration(mu))
        assert abs(found - np.sqrt(low * high)) < 0.02 * found
        system = _system(omega, damping, amplitude - depth)
        turn = 2 * np.pi / omega
        start = jnp.array([amplitude - 2 * depth, 0.0])
        t0 = float(form.time)
        settled = _end(system, start, jnp.asarray(t0), jnp.asarray(t0 + 24 * turn))
        later = _end(system, settled.state, jnp.asarray(t0), jnp.asarray(t0 + m * turn))
        assert int(later.impacts) == 1
        np.testing.assert_allclose(later.state, settled.state, atol=1e-6)
