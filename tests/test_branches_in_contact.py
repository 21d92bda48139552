"""Branches of orbits that are in contact at all times, against a pendulum."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import continuation
from jaxcam.hybrid import HybridSystem, simulate, SwitchedSystem
from jaxcam.hybrid.surface import gaps, normal_velocity, onto_contacts


def number(default: float):
    return eqx.field(default=default, converter=lambda v: jnp.asarray(v, float))


class Bowl(SwitchedSystem):
    """A bead in a circular bowl of radius one, which is shaken sideways."""

    amplitude: Any = number(0.2)
    omega: Any = number(0.7)
    damping: Any = number(0.2)

    @property
    def period(self):
        return 2 * jnp.pi / self.omega

    def switching(self, t, state):
        x, y, u, v = state
        return u * y - v * x

    def branch(self, t, state, sides):
        x, y, u, v = state
        shaken = self.amplitude * jnp.cos(self.omega * t)
        return jnp.stack([u, v, shaken - self.damping * u, -1.0 - self.damping * v])

    def gap(self, t, state):
        return 1.0 - jnp.sqrt(state[0] ** 2 + state[1] ** 2)

    def impact(self, t, state):
        x, y, u, v = state
        r = jnp.sqrt(x**2 + y**2)
        normal = (x * u + y * v) / r
        return state - jnp.stack(
            [0.0 * x, 0.0 * x, 1.3 * normal * x / r, 1.3 * normal * y / r]
        )


class Pendulum(HybridSystem):
    """The same motion in the angle from the bottom."""

    amplitude: Any = number(0.2)
    omega: Any = number(0.7)
    damping: Any = number(0.2)

    @property
    def period(self):
        return 2 * jnp.pi / self.omega

    def vector_field(self, t, state):
        angle, rate = state
        shaken = self.amplitude * jnp.cos(self.omega * t) * jnp.cos(angle)
        return jnp.stack([rate, shaken - jnp.sin(angle) - self.damping * rate])


def in_bowl(state):
    angle, rate = state
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.array([sine, -cosine, rate * cosine, rate * sine])


def test_a_branch_in_contact_takes_full_steps():
    """From an amplitude of 0.2 to 0.5 in at most 25 points; at the end, the state is
    that of the pendulum to 1e-8, and two of the multipliers are its multipliers to
    1e-6, the others zero.
    """
    start = in_bowl(continuation.periodic_orbit(Pendulum()).state)
    found = continuation.branch(
        Bowl(),
        continuation.periodic_orbit(Bowl(), start),
        "amplitude",
        (0.1, 0.5),
        settings=continuation.BranchSettings(max_points=40),
    )
    end = found.points[-1]
    x, y, u, v = end.observed["state"]
    near = [np.arctan2(x, -y), -u * y + v * x]
    known = continuation.periodic_orbit(Pendulum(amplitude=0.5), near)
    assert end.parameter == pytest.approx(0.5, abs=1e-9)
    assert len(found.points) <= 25
    # the orbit of the pendulum may be given at another time
    bowl, state = Bowl(amplitude=0.5), end.observed["state"]
    there = simulate(bowl, state, 0.0, float(known.time), tolerance=1e-12).final
    np.testing.assert_allclose(there, in_bowl(known.state), atol=1e-8)
    sizes, wanted = (np.sort(np.abs(one.multipliers)) for one in (end, known))
    np.testing.assert_allclose(sizes[:2], 0.0, atol=1e-6)
    np.testing.assert_allclose(sizes[2:], wanted, rtol=1e-6)
    assert "held 0" in end.signature


def test_the_bead_stays_in_contact_on_the_orbit():
    """What the branch relies on: a simulation of the bowl has one contact, from start
    to end, and follows the pendulum to 1e-8.
    """
    first = np.array([0.2, 0.1])
    run = simulate(Bowl(), in_bowl(first), 0.0, 3.0, tolerance=1e-11)
    other = simulate(Pendulum(), first, 0.0, 3.0, tolerance=1e-11)
    assert int(run.contacts.count) == 1 and int(run.impacts.count) == 0
    np.testing.assert_allclose(run.final, in_bowl(other.final), atol=1e-8)


def test_a_state_is_moved_onto_the_constraint():
    """Gap and normal velocity to 1e-14, from a tenth of the radius away."""
    away = jnp.array([0.5, -0.8, 0.4, 0.1])
    system, scale = Bowl(), jnp.ones(4)
    near = onto_contacts(system, 0.0, away, (0,), scale)
    assert abs(float(gaps(system, 0.0, near)[0])) < 1e-14
    assert abs(float(normal_velocity(system, 0.0, near)[0])) < 1e-14
    assert float(jnp.max(jnp.abs(near - away))) < 0.15
