"""Grazing and interruption of chatter as published values, against closed forms.

Without impacts x'' + 2 z x' + x = cos(w t) moves with the amplitude
1 / sqrt((1 - w^2)^2 + 4 z^2 w^2), so it touches a wall at d where

    w^2 = 1 - 2 z^2 +- sqrt((1 - 2 z^2)^2 - 1 + 1 / d^2).
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from oscillator_hops import completes
from scipy.optimize import fsolve, minimize_scalar

from jaxcam.fitting import (
    fit_published,
    interruption_of_chattering,
    Published,
)
from jaxcam.models import (
    BouncingBall,
    ImpactOscillator,
    preset,
    rad_s_to_rpm,
    rpm_to_rad_s,
)
from variational import graze_of_orbit
from variational.orbits import clearance, ImpactOrbit


def omega(system):
    return system.omega


def touching(damping, wall, side):
    """Frequency of the graze, above (+1) or below (-1) the resonance."""
    middle = 1 - 2 * damping**2
    return jnp.sqrt(middle + side * jnp.sqrt(middle**2 - 1 + 1 / wall**2))


def oscillator(damping, wall, w=1.0):
    return ImpactOscillator(
        omega=jnp.asarray(w),
        restitution=jnp.asarray(0.8),
        wall=jnp.asarray(wall),
        damping=jnp.asarray(damping),
    )


def lag(damping, w):
    return math.atan2(2 * damping * w, 1 - w * w)


@eqx.filter_jit
def grazing(system, guess):
    return graze_of_orbit(system, omega, guess)


def graze(damping, wall, near, guessed=(0.12, 1.9)):
    """Of an oscillator near a graze; the guess is that of other parameters."""
    time = lag(guessed[0], near) / near
    guess = ImpactOrbit(jnp.array([time]), jnp.array([[guessed[1], 0.01]]))
    return grazing(oscillator(damping, wall, near), guess)


@pytest.mark.parametrize("side", [1, -1])
def test_graze_of_the_oscillator_without_impacts(side):
    z, d = 0.1, 2.0
    exact = float(touching(z, d, side))
    near = exact + 0.03
    point = graze(z, d, near)
    assert_allclose(point.parameter, exact, rtol=1e-12)
    phase = float(point.orbit.times[0]) * exact
    assert_allclose(math.remainder(phase - lag(z, exact), 2 * math.pi), 0, atol=1e-10)
    assert_allclose(point.orbit.states[0], [d, 0.0], atol=1e-12)


@pytest.mark.parametrize("side", [1, -1])
def test_slopes_of_a_graze_are_those_of_the_closed_form(side):
    both = jnp.array([0.1, 2.0])
    near = float(touching(*both, side)) + 0.02

    def found(both):
        return graze(both[0], both[1], near).parameter

    exact = jax.jacfwd(lambda both: touching(*both, side))(both)
    assert_allclose(jax.jacfwd(found)(both), exact, rtol=1e-9)


def test_damping_and_wall_from_two_printed_grazes():
    """One below the resonance and one above it tell both."""
    truth = np.array([0.1, 2.0])
    printed = [float(touching(*truth, side)) for side in (-1, 1)]

    def computed(system):
        return jnp.stack(
            [graze(system.damping, system.wall, w).parameter for w in printed]
        )

    fit = fit_published(
        oscillator(0.12, 1.9),
        lambda s: (s.damping, s.wall),
        [Published("grazes", computed, printed, 1e-6)],
        names=["damping", "wall"],
        tolerances=[np.inf, np.inf],
    )
    assert fit.converged
    assert_allclose(fit.estimates, truth, rtol=1e-9)


# ---- the ball on a shaken floor, where an orbit that hits once a period grazes -------


def ball_graze(r):
    """Phases of bounce and graze, and amplitude, with g = w = 1.

    The saddle of the orbits with one bounce: the floor is low at the bounce, and so
    strong that it meets the ball in its flight.
    """

    def equations(unknowns):
        bounce, touch, a = unknowns
        flown = touch - bounce
        return [
            a * math.cos(bounce) - math.pi * (1 - r) / (1 + r),
            math.pi * flown - flown**2 / 2 - a * (math.sin(touch) - math.sin(bounce)),
            math.pi - flown - a * math.cos(touch),
        ]

    found = fsolve(equations, [-1.1, 1.0, 2.5], xtol=1e-13)
    assert max(map(abs, equations(found))) < 1e-13
    return found


@eqx.filter_jit
def ball_grazing(system, guess):
    return graze_of_orbit(system, lambda s: s.amplitude, guess)


def ball(r, a):
    return BouncingBall(
        gravity=jnp.asarray(1.0),
        restitution=jnp.asarray(r),
        amplitude=jnp.asarray(a),
        frequency=jnp.asarray(1.0),
    )


def ball_guess(r):
    bounce, touch, a = ball_graze(r)
    times = jnp.array([touch, bounce + 2 * math.pi])
    states = jnp.array(
        [[a * math.sin(touch), a * math.cos(touch)], [a * math.sin(bounce), math.pi]]
    )
    return ImpactOrbit(times + 1e-3, states - 1e-3), a


def test_graze_of_an_orbit_with_an_impact():
    r = 0.5
    bounce, touch, a = ball_graze(r)
    guess, _ = ball_guess(r)
    point = ball_grazing(ball(r, 1.01 * a), guess)
    assert_allclose(point.parameter, a, rtol=1e-11)
    assert_allclose(point.orbit.times, [touch, bounce + 2 * math.pi], rtol=1e-10)
    # the gap has a minimum there: short of the graze the flight is free
    assert -1.0 + a * math.sin(touch) > 0
    alone = ImpactOrbit(point.orbit.times[1:], point.orbit.states[1:])
    assert_allclose(clearance(ball(r, float(point.parameter)), alone), 0, atol=1e-12)


def test_clearance_is_the_lowest_gap_and_not_that_at_the_ends_of_steps():
    """Behind the graze the ball passes through the floor for less than a step.

    Its flight is a parabola: the lowest gap of the closed form, to 1e-12.
    """
    r = 0.5
    _, touch, a = ball_graze(r)
    a = 1.0001 * a
    bounce = -math.acos(math.pi * (1 - r) / (1 + r) / a)
    start = ImpactOrbit(
        jnp.array([bounce]), jnp.array([[a * math.sin(bounce), math.pi]])
    )

    def gap(t):
        flown = t - bounce
        lift = a * (math.sin(t) - math.sin(bounce))
        return math.pi * flown - flown**2 / 2 - lift

    around = {"bounds": (touch - 0.2, touch + 0.2), "options": {"xatol": 1e-12}}
    lowest = minimize_scalar(gap, **around)["fun"]
    assert lowest < -1e-5
    assert_allclose(clearance(ball(r, a), start), lowest, rtol=0, atol=1e-12)


def test_slope_of_a_graze_with_an_impact():
    r, h = 0.5, 1e-5
    guess, a = ball_guess(r)
    slope = jax.jacfwd(lambda r: ball_grazing(ball(r, a), guess).parameter)(
        jnp.asarray(r)
    )
    exact = (ball_graze(r + h)[2] - ball_graze(r - h)[2]) / (2 * h)
    assert_allclose(slope, exact, rtol=1e-7)


# ---- complete chattering that ends at the release ------------------------------------


def test_restitution_from_a_printed_interruption():
    """With the fitted restitution it ends at the printed frequency, hop by hop."""
    printed = 0.62

    def computed(system):
        return interruption_of_chattering(system, omega, (0.45, 0.9))

    fit = fit_published(
        ImpactOscillator(omega=0.6, restitution=0.47, wall=0.0, damping=0.0),
        lambda s: (s.restitution,),
        [Published("interruption", computed, printed, 1e-4)],
        names=["r"],
        tolerances=[np.inf],
    )
    assert fit.converged
    r = float(fit.estimates[0])
    assert completes(printed * (1 - 1e-9), r)
    assert not completes(printed * (1 + 1e-9), r)
    nowhere = interruption_of_chattering(fit.model, omega, (0.8, 0.9))
    assert np.isnan(nowhere)


@pytest.mark.slow
def test_interruption_of_the_calibrated_rig():
    """Printed with five decimals; its slope against central differences."""
    rig = preset("calibrated")
    bracket = (float(rpm_to_rad_s(150.0)), float(rpm_to_rad_s(154.0)))

    @eqx.filter_jit
    def computed(stiffness):
        moved = eqx.tree_at(lambda s: s.stiffness, rig, stiffness)
        return interruption_of_chattering(moved, lambda s: s.speed, bracket)

    k = jnp.asarray(rig.stiffness, dtype=float)
    assert abs(float(rad_s_to_rpm(computed(k))) - 152.67658) < 0.002
    slope = jax.jacfwd(computed)(k)
    h = 1e-5 * float(k)
    ends = [float(computed(k + side * h)) for side in (-1, 1)]
    assert_allclose(slope, (ends[1] - ends[0]) / (2 * h), rtol=1e-6)
