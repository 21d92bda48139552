"""Orbits, special points and fits to printed numbers, against closed forms.

The ball on a sinusoidal floor y = A sin(w t) has an orbit with one bounce a period T.
With k = (1 + r) / g it has, from the linearised flight and impact,

    A w cos(w t) = (g T / 2) (1 - r) / (1 + r),
    trace = 1 + r^2 - (1 + r) k A w^2 sin(w t),    determinant = r^2.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from jaxcam.fitting import fit_published, Published
from jaxcam.fitting.published import fit_free_fall, rounding_error
from jaxcam.models import BouncingBall, CamFollower, TripleIntegrator
from variational import (
    detachment,
    flip_of_orbit,
    fold_of_orbit,
    impact_orbit,
    orbit_determinant,
    orbit_trace,
    release_near,
)
from variational.orbits import clearance, ImpactOrbit, implicit_root, one_impact_orbits


G, R, W = 9.81, 0.5, 20.0
T = 2 * math.pi / W
SPEED = G * T / 2 * (1 - R) / (1 + R)  # of the floor at a bounce
BALL = BouncingBall(restitution=R, amplitude=0.05, frequency=W)


def amplitude(system):
    return system.amplitude


def bounce(a):
    """Phase of the bounce on the rising, stable side (rad)."""
    return math.acos(SPEED / (a * W))


def trace(a):
    return 1 + R * R - (1 + R) ** 2 / G * a * W * W * math.sin(bounce(a))


def near(a):
    return ImpactOrbit(
        jnp.array([bounce(a) / W + 1e-3]),
        jnp.array([[a * math.sin(bounce(a)) + 1e-3, G * T / 2 + 0.02]]),
    )


@eqx.filter_jit
def found(system, guess):
    orbit = impact_orbit(system, guess)
    return orbit, orbit_trace(system, orbit), orbit_determinant(system, orbit)


def test_root_and_its_derivative():
    def root(a):
        return implicit_root(lambda x: x * x - a, jnp.array([1.0]))[0]

    a = jnp.array([2.0])
    assert_allclose(root(a), math.sqrt(2), rtol=1e-14)
    assert_allclose(jax.jacfwd(root)(a)[0], 0.5 / math.sqrt(2), rtol=1e-14)
    assert_allclose(jax.jacrev(root)(a)[0], 0.5 / math.sqrt(2), rtol=1e-14)
    assert np.isnan(root(jnp.array([-1.0])))


def test_orbit_and_multipliers_of_the_ball():
    a = 0.03
    system = eqx.tree_at(amplitude, BALL, jnp.asarray(a))
    orbit, total, product = found(system, near(a))
    assert_allclose(orbit.times[0] * W, bounce(a), rtol=1e-11)
    assert_allclose(orbit.states[0, 1], G * T / 2, rtol=1e-12)
    assert_allclose(total, trace(a), rtol=1e-10)
    assert_allclose(product, R * R, rtol=1e-10)
    assert float(clearance(system, orbit)) > 0


def test_derivative_of_a_trace_is_that_of_the_closed_form():
    a, step = 0.03, 1e-6

    def total(value):
        return found(eqx.tree_at(amplitude, BALL, value), near(a))[1]

    slope = jax.jacfwd(total)(jnp.asarray(a))
    assert_allclose(slope, (trace(a + step) - trace(a - step)) / (2 * step), rtol=1e-7)


@pytest.mark.slow
def test_fold_and_flip_of_the_ball():
    """The orbit is born where A w is the speed at a bounce, and doubles later."""
    born = SPEED / W
    system = eqx.tree_at(amplitude, BALL, jnp.asarray(1.02 * born))
    fold = fold_of_orbit(system, amplitude, near(1.02 * born))
    assert_allclose(fold.parameter, born, rtol=1e-9)
    lift = 2 * G * (1 + R * R) / (1 + R) ** 2 / W**2
    double = math.hypot(born, lift)
    system = eqx.tree_at(amplitude, BALL, jnp.asarray(0.9 * double))
    flip = flip_of_orbit(system, amplitude, near(0.9 * double))
    assert_allclose(flip.parameter, double, rtol=1e-10)


def test_contact_of_the_ball_is_lost():
    """First where A w^2 reaches g; above that, where A w^2 sin(w t) does."""
    edge = G / W**2
    system = eqx.tree_at(amplitude, BALL, jnp.asarray(1.1 * edge))
    state = jnp.array([1.1 * edge, 0.0])
    lost = detachment(system, amplitude, 0.9 * T / 4, state)
    assert_allclose(lost.parameter, edge, rtol=1e-8)
    time, state = release_near(system, 0.8 * T / 4, state)
    assert_allclose(time * W, math.asin(1 / 1.1), rtol=1e-10)
    assert_allclose(state[0], edge, rtol=1e-10)


def test_search_finds_node_and_saddle():
    """Both orbits of the ball, the saddle last, and none where there is none."""
    a = 0.03
    system = eqx.tree_at(amplitude, BALL, jnp.asarray(a))
    node, saddle = one_impact_orbits(system, jnp.zeros(2))
    assert_allclose(node.times[0] * W, bounce(a), rtol=1e-9)
    assert_allclose(saddle.times[0] * W, 2 * math.pi - bounce(a), rtol=1e-9)
    low = eqx.tree_at(amplitude, BALL, jnp.asarray(0.9 * SPEED / W))
    assert one_impact_orbits(low, jnp.zeros(2)) == []


def _published():
    """What would be printed of the ball with A = 0.03 and r = 0.5."""
    a = 0.03

    def numbers(system):
        orbit, total, product = found(system, near(a))
        return jnp.stack([total, product, orbit.times[0]])

    def doubling(system):
        return flip_of_orbit(system, amplitude, near(a)).parameter

    lift = 2 * G * (1 + R * R) / (1 + R) ** 2 / W**2
    truth = [trace(a), R * R, bounce(a) / W]
    return [
        Published("orbit", numbers, truth, [1e-6, 1e-6, 1e-8]),
        Published("flip", doubling, math.hypot(SPEED / W, lift), 1e-6),
    ]


def _start(a, r, gravity=G):
    start = BouncingBall(gravity=gravity, restitution=r, amplitude=a, frequency=W)
    return start


@pytest.mark.slow
def test_fit_to_printed_numbers_finds_the_truth():
    fit = fit_published(
        _start(0.031, 0.48),
        lambda s: (s.amplitude, s.restitution),
        _published(),
        names=["A", "r"],
        tolerances=[np.inf, np.inf],
    )
    assert fit.converged
    assert_allclose(fit.estimates, [0.03, R], rtol=1e-9)
    assert_allclose(fit.model.restitution, R, rtol=1e-9)
    assert fit.chi_square < 1e-6
    assert fit.weak() == []
    assert list(fit.parameters()["parameter"]) == ["A", "r"]
    assert len(fit.numbers()) == 4


def test_priors_and_covariance_of_a_linear_model():
    """With y = p + q alone, p and q keep their priors apart from the sum."""

    class Pair(eqx.Module):
        p: jax.Array
        q: jax.Array

    sigma, prior = 0.01, 2.0
    fit = fit_published(
        Pair(jnp.asarray(1.0), jnp.asarray(1.0)),
        lambda m: [m.p, m.q],
        [Published("sum", lambda m: m.p + m.q, 3.0, sigma)],
        names=["p", "q"],
        tolerances=[prior, prior],
    )
    information = np.ones((2, 2)) / sigma**2 + np.eye(2) / prior**2
    assert_allclose(fit.covariance, np.linalg.inv(information), rtol=1e-8)
    shift = 1.0 * 2 * prior**2 / (2 * prior**2 + sigma**2) / 2
    assert_allclose(fit.estimates, [1 + shift, 1 + shift], rtol=1e-9)
    assert_allclose(fit.shares, [0.0, 1.0], atol=1e-4)
    (sentence,) = fit.weak()
    assert "p" in sentence and "q" in sentence and "0 %" in sentence


def test_the_optimum_is_that_of_optimistix():
    """A decay that bends in its parameters, with priors that pull."""

    class Decay(eqx.Module):
        rate: jax.Array
        size: jax.Array

    times = jnp.linspace(0.0, 3.0, 7)

    def values(m):
        return m.size * jnp.exp(-m.rate * times)

    nominal, priors, sigma = np.array([0.5, 1.0]), np.array([0.5, 0.3]), 0.02
    printed = np.round(np.asarray(values(Decay(jnp.asarray(0.9), jnp.asarray(2.0)))), 1)
    fit = fit_published(
        Decay(jnp.asarray(nominal[0]), jnp.asarray(nominal[1])),
        lambda m: (m.rate, m.size),
        [Published("decay", values, printed, sigma)],
        names=["rate", "size"],
        tolerances=priors,
    )

    def misses(p, _):
        off = (values(Decay(*p)) - printed) / sigma
        return jnp.append(off, (p - nominal) / priors)

    solver = optx.LevenbergMarquardt(rtol=1e-12, atol=1e-12)
    dense = optx.least_squares(misses, solver, jnp.asarray(nominal))
    assert_allclose(fit.estimates, dense.value, rtol=1e-8)


def test_wrong_input_is_refused():
    model = _start(0.03, R)
    number = Published("r", lambda s: s.restitution, 0.4, 0.1)
    with pytest.raises(ValueError, match="`names`"):
        fit_published(
            model, lambda s: [s.restitution], [number], names=[], tolerances=[1.0]
        )
    with pytest.raises(ValueError, match="positive `tolerances`"):
        fit_published(
            model, lambda s: [s.restitution], [number], names=["r"], tolerances=[0.0]
        )
    with pytest.raises(ValueError, match="positive standard errors"):
        Published("r", lambda s: s.restitution, 0.4, 0.0)
    lost = Published("root", lambda s: jnp.sqrt(-s.restitution), 0.4, 0.1)
    with pytest.raises(ValueError, match="root cannot be computed"):
        fit_published(
            model, lambda s: [s.restitution], [lost], names=["r"], tolerances=[1.0]
        )
    with pytest.raises(ValueError, match="`period`"):
        one_impact_orbits(TripleIntegrator(), jnp.zeros(2))


def test_rounding_error():
    values = np.linspace(0.0, 1.0, 100_003)
    assert_allclose(rounding_error(2), np.std(np.round(values, 2) - values), rtol=1e-2)


def test_free_fall_gives_inertia_over_stiffness():
    """Section 4.6: M = J/K from an angle with noise, inside its standard errors."""
    system = CamFollower()
    times = np.linspace(0.0, 0.3, 151)
    start = np.array([0.5, 1.0])

    def field(t, x):
        reach = -0.031 * np.tan(x[0]) + 0.021 / np.cos(x[0])
        arm = (-0.031 + 0.021 * np.sin(x[0])) / np.cos(x[0]) ** 2
        return [x[1], -(98.0 / 0.043) * (reach - 0.173) * arm]

    exact = solve_ivp(
        field, (0, 0.3), start, method="DOP853", t_eval=times, rtol=1e-12, atol=1e-12
    ).y[0]

    def fit(values, error):
        return fit_free_fall(
            system,
            lambda s: s.stiffness,
            times,
            values,
            error,
            state=np.array([values[0], 0.5]),
        )

    clean = fit(exact, 1e-6)
    assert_allclose(clean.model.system.stiffness, 98.0, rtol=1e-9)
    assert_allclose(clean.model.state, start, rtol=1e-9)
    noise = 1e-4
    rng = np.random.default_rng(4)
    noisy = fit(exact + noise * rng.standard_normal(len(times)), noise)
    shift = (noisy.estimates - [98.0, *start]) / noisy.stderr
    assert np.all(np.abs(shift) < 4)
    assert 90 < noisy.chi_square < 220  # 148 expected, 17 its deviation
    assert dataclasses.is_dataclass(noisy)
