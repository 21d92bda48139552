"""Covariant Lyapunov vectors: eigenvectors of an orbit, and carried along by chaos."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import parameters

import jaxcam
import variational
from jaxcam.models import ImpactOscillator, TripleIntegrator


def _oscillator(omega, damping=0.02, wall=-0.2):
    return ImpactOscillator(
        **parameters(omega=omega, restitution=0.8, wall=wall, damping=damping)
    )


#: P(2,2) with two real multipliers; and chaos
NODE, CHAOS = 3.3, 3.5


def _vectors(system, start=(-0.9, 0.0)):
    # of one length, so that one compiled program serves all
    return variational.covariant_vectors(system, jnp.array(start), 300, transient=200)


def _along(a, b):
    """Sine of the angle between the columns of two arrays (..., n, n)."""
    dot = np.abs(np.einsum("...ij,...ij->...j", a, b))
    size = np.linalg.norm(a, axis=-2) * np.linalg.norm(b, axis=-2)
    return np.sqrt(np.maximum(1 - (dot / size) ** 2, 0.0))


def test_eigenvectors_of_a_periodic_orbit():
    """Directions to 1e-6, exponents as of the multipliers to 1e-8."""
    system = _oscillator(NODE)
    found = _vectors(system)
    assert int(found.code) == 0
    orbit = variational.orbit_of(system, found.state[0], 2 * system.period)
    matrix = np.asarray(variational.monodromy(system, orbit))
    values, vectors = np.linalg.eig(matrix)
    assert np.all(np.isreal(values))
    order = np.argsort(-np.abs(values))
    assert np.all(_along(np.asarray(found.vectors[0]), vectors[:, order].real) < 1e-6)
    exact = np.log(np.abs(values[order])) / float(orbit.period)
    np.testing.assert_allclose(found.exponents, exact, atol=1e-8)


def test_chaos_carries_them_along():
    """Each turn takes each to the next, by differences of the motion, to 1e-4."""
    system = _oscillator(CHAOS)
    found = _vectors(system)
    period = float(system.period)
    assert float(found.exponents[0]) > 0 > float(found.exponents[1])

    def end(x):
        return np.asarray(jaxcam.simulate(system, x, 0.0, period).final)

    angles = np.asarray(found.angle)
    for k in range(0, 40, 8):
        x = np.asarray(found.state[k])
        for j in range(2):
            c = np.asarray(found.vectors[k, :, j])
            step = 1e-7
            moved = (end(x + step * c) - end(x - step * c)) / (2 * step)
            grown = np.log(np.linalg.norm(moved)) / period
            sine = _along(
                moved[:, None], np.asarray(found.vectors[k + 1, :, j : j + 1])
            )
            assert sine < 1e-4, (k, j)
            assert abs(grown - float(found.local[k, j])) < 1e-4
    assert angles.min() >= 0 and angles.max() > 0.3


def test_mean_growth_is_the_spectrum():
    """The same exponents as by QR over 6000 periods, as far as 300 periods tell (four
    standard errors).
    """
    system = _oscillator(CHAOS)
    found = _vectors(system)
    known = variational.lyapunov_spectrum(system, [-0.9, 0.0], 6000, transient=200)
    apart = np.abs(np.asarray(found.exponents) - np.asarray(known.exponents))
    stderr = np.asarray(known.stderr) * np.sqrt(6000 / 300)
    assert np.all(apart < 4 * stderr)
    # their sum is that of the volume, which depends only on the impact rate
    volume = float(known.exponents.sum())
    assert abs(float(found.exponents.sum()) - volume) < 0.05 * abs(volume)


def test_in_a_batch_and_where_it_sticks():
    """Lanes of a vmap are those alone, to 1e-9; a motion that sticks has none."""
    starts = jnp.array([[-0.9, 0.0], [-0.8, 0.1]])

    def one(x):
        return variational.covariant_vectors(_oscillator(NODE), x, 4, transient=200)

    both, first = jax.vmap(one)(starts), one(starts[0])
    np.testing.assert_allclose(both.vectors[0], first.vectors, atol=1e-9)
    sticks = ImpactOscillator(
        **parameters(omega=1.0, restitution=0.1, wall=-0.9, damping=0.1)
    )
    found = _vectors(sticks, (-1.5, 0.0))
    assert int(found.code) == 0 and np.all(np.isnan(np.asarray(found.vectors)))


def test_what_makes_no_sense_is_refused():
    system = _oscillator(NODE)
    with pytest.raises(ValueError, match="1 or more"):
        variational.covariant_vectors(system, jnp.array([-0.9, 0.0]), 0)
    with pytest.raises(ValueError, match="period"):
        variational.covariant_vectors(TripleIntegrator(), jnp.zeros(3))
