"""The lambda-map, its scaling law and the beta-map against their own definitions."""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

from jaxcam.hybrid import HybridSystem
from jaxcam.models import TripleIntegrator
from variational import (
    beta_map,
    chatter_interruption,
    koenigs,
    lambda_inverse,
    lambda_map,
    scaling_law,
)
from variational.chatter import beta_parts, hop_ratio, next_impact


RESTITUTIONS = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95]


def flight(v, a):
    """Next impact of x'' = a + t from rest on the wall with speed v, to 40 digits."""
    # v + a s / 2 + s^2 / 6 = 0
    root = mpmath.sqrt(a * a / 4 - 2 * v / 3)
    s = (-a / 2 - root) * 3
    return s, v + a * s + s * s / 2


@pytest.mark.parametrize("r", RESTITUTIONS)
def test_scaling_law_to_rounding(r):
    with mpmath.workdps(40):
        s = mpmath.findroot(
            lambda s: 9 * s**3 + 3 * s**2 - (5 + 8 * mpmath.mpf(r)) * s + 1, (1, 0.99)
        )
        assert mpmath.mpf(1) / 3 < s < 1
        p = (3 * s - 1) / 2
        f = (1 + s) ** 2 / (4 * s**2 * p)
        kappa = 2 * mpmath.log(p) / mpmath.log(1 / f)
        exact = [float(v) for v in (3 * (1 - s**2) / 8, p, 1 / f, kappa)]
    law = scaling_law(r)
    found = [float(v) for v in (law.lambda_bar, law.p, law.q, law.kappa)]
    assert np.max(np.abs(np.array(found) / exact - 1)) < 1e-12
    # what they stand for
    assert abs(float(lambda_map(law.lambda_bar, r) - law.lambda_bar)) < 1e-12
    assert abs(float(hop_ratio(law.lambda_bar) - law.p)) < 1e-12
    slope = jax.grad(lambda_map)(law.lambda_bar, r)
    assert abs(float(slope * law.q) - 1) < 1e-12


@pytest.mark.parametrize("r", RESTITUTIONS)
def test_lambda_map_is_one_flight_of_the_triple_integrator(r):
    for lam in (1e-9, 1e-3, 0.1, 0.3, 0.34, 0.374):
        with mpmath.workdps(40):
            a = mpmath.mpf(-2)
            s, speed = flight(mpmath.mpf(lam) * a * a, a)
            ratio = float((a + s) / a)
            after = float(-mpmath.mpf(r) * speed / (a + s) ** 2)
        # the pole at 1/3 and the corner at 3/8 amplify rounding by the distance
        close = 1e-13 / min(abs(lam - 1 / 3), abs(lam - 3 / 8)) ** 0.5
        assert abs(float(hop_ratio(lam)) - ratio) < close
        assert abs(float(lambda_map(lam, r)) / after - 1) < 100 * close
    assert np.isnan(float(lambda_map(0.376, r)))


class Rising(HybridSystem):
    """x'' = t - 1 above a wall at zero: a flight whose pull turns into a push."""

    def vector_field(self, t, state):
        return jnp.stack([state[1], t - 1.0])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -0.5 * state[1]])


def test_flights_that_almost_miss_the_wall_are_seen_to_hit_it():
    """For a speed below 3/8 the wall is met, at 3/8 grazed: then the gap is negative
    for a moment only. Time of impact against the root of the cubic."""
    found = jax.jit(
        jax.vmap(lambda v: next_impact(Rising(), 0.0, v * jnp.eye(2)[1], v, 20.0))
    )
    missing = np.concatenate([np.logspace(-9, -0.5, 60), np.linspace(0.3, 0.99, 40)])
    speeds = 0.375 * (1 - missing)
    points = found(jnp.asarray(speeds))
    assert np.all(points.found)
    for v, time in zip(speeds, np.asarray(points.time), strict=True):
        with mpmath.workdps(40):
            exact = float(flight(mpmath.mpf(float(v)), mpmath.mpf(-1))[0])
        # near the graze rounding moves the root by about its square root
        assert abs(time - exact) < 1e-13 / abs(1 - v / 0.375) ** 0.5 + 1e-14
    assert not np.any(found(jnp.asarray([0.3751, 0.4])).found)


@pytest.mark.parametrize("r", [0.2, 0.6, 0.9])
def test_inverse_and_multiplication_coordinate(r):
    law = scaling_law(r)
    lam = jnp.array([1e-6, 0.01, float(law.lambda_bar), 0.2, 0.3])
    back = lambda_inverse(lambda_map(lam, r), r)
    assert float(jnp.max(jnp.abs(back / lam - 1))) < 1e-10
    for value in (0.9 * float(law.lambda_bar), float(law.lambda_bar) + 1e-5, 0.3):
        here = koenigs(value, law.lambda_bar, r, law.q)
        there = koenigs(lambda_map(value, r), law.lambda_bar, r, law.q)
        assert abs(float(there * law.q / here) - 1) < 1e-9


@pytest.mark.parametrize("r", [0.3, 0.6, 0.8])
def test_beta_is_what_the_triple_integrator_leaves(r):
    law = scaling_law(r)
    deviation = 10.0 ** np.linspace(-4, np.log10(0.4), 25)
    lams = float(law.lambda_bar) + deviation
    parts = beta_parts(lams, r)
    for lam, beta, gamma, impacts in zip(
        lams, parts.beta, parts.gamma, parts.impacts, strict=True
    ):
        with mpmath.workdps(60):
            t, v, count = mpmath.mpf(-1), mpmath.mpf(float(lam)), 0
            while t < 0 and v <= 3 * t * t / 8:
                s, speed = flight(v, t)
                t, v, count = t + s, -mpmath.mpf(r) * speed, count + 1
            # at time 3: velocity t^2/2 + beta, position t^3/6 + beta t + gamma
            end = 3 - t
            velocity = v + t * end + end**2 / 2
            position = v * end + t * end**2 / 2 + end**3 / 6
            exact = float(velocity - mpmath.mpf(9) / 2)
            rest = float(position - mpmath.mpf(27) / 6) - 3 * exact
        # rounding in lambda grows with the slope, which is 1/deviation^(1 - kappa/2)
        assert abs(float(beta) - exact) < 1e-9
        # the sequence starts at tau = -1
        assert abs(-float(gamma) - rest) < 1e-9
        assert int(impacts) == count
    assert float(beta_map(0.99 * float(law.lambda_bar), r)) == 0.0


@pytest.mark.parametrize("r", [0.3, 0.6])
def test_one_lobe_in_closed_form_and_its_scales(r):
    # (6.46), on the lobe between the corner 3/8 and its pre-image
    inner = float(lambda_inverse(3 / 8, r))
    lam = np.linspace(inner + 1e-9, 3 / 8, 40)
    closed = (3 + 2 * r) * lam + (r + 1) / 4 * np.sqrt(9 - 24 * lam) - (3 * r + 5) / 4
    assert np.max(np.abs(np.asarray(beta_map(lam, r)) - closed)) < 1e-12
    # corners approach lambda_bar by q, heights of the lobes shrink by p^2
    law = scaling_law(r)
    corners = [3 / 8]
    for _ in range(14):
        corners.append(float(lambda_inverse(corners[-1], r)))
    distance = np.array(corners) - float(law.lambda_bar)
    assert abs(distance[-1] / distance[-2] / float(law.q) - 1) < 1e-3
    values = np.asarray(beta_map(np.array(corners), r))
    assert abs(values[-1] / values[-2] / float(law.p) ** 2 - 1) < 1e-3


def test_scaling_law_takes_batches_and_refuses_what_is_no_restitution():
    law = scaling_law(np.array(RESTITUTIONS))
    one = scaling_law(RESTITUTIONS[3])
    assert law.p.shape == (len(RESTITUTIONS),)
    assert float(law.kappa[3]) == float(one.kappa)
    for r in (0.0, 1.0, -0.2, np.nan):
        with pytest.raises(ValueError, match="between 0 and 1"):
            scaling_law(r)


def test_a_system_without_period_is_refused():
    with pytest.raises(ValueError, match="forcing period"):
        chatter_interruption(TripleIntegrator(), lambda s: s.restitution, (0.1, 0.5))
