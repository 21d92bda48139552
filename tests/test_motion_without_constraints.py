"""Systems without constraints, and gaps whose gradient vanishes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxcam
from jaxcam.data import PENDULUM
from jaxcam.fitting import read_setup
from jaxcam.hybrid import flow, Settings
from jaxcam.hybrid.checks import missing_method


class Oscillator(jaxcam.HybridSystem):
    """State: position and velocity; no constraints."""

    stiffness: float = 4.0

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.stiffness * state[0]])


class Distant(Oscillator):
    """The same with a gap that does not depend on the state."""

    def gap(self, t, state):
        return jnp.ones_like(t)

    def impact(self, t, state):
        return state


class Rotor(jaxcam.HybridSystem):
    """A resonant rotor in a circular clearance: x, y and their rates."""

    def vector_field(self, t, state):
        forces = jnp.cos(t) - state[0], jnp.sin(t) - state[1]
        return jnp.stack([state[2], state[3], *forces])

    def gap(self, t, state):
        return (1.0 - state[0] ** 2 - state[1] ** 2) / 2

    def impact(self, t, state):
        x, y, u, v = state
        push = 1.5 * (x * u + y * v)
        return jnp.stack([x, y, u - push * x, v - push * y])


@pytest.mark.parametrize("backend", ["xla", "llvm"])
@pytest.mark.parametrize("system", [Oscillator(), Distant()])
def test_an_oscillation_without_constraints(system, backend):
    """The solution is cos(2 t), to 1e-9; there are no events."""
    times = jnp.linspace(0.0, 5.0, 11)
    settings = Settings(backend=backend)
    run = jaxcam.simulate(system, [1.0, 0.0], 0.0, 5.0, settings=settings)
    assert run.successful and int(run.impacts.count) == 0
    exact = np.stack([np.cos(2 * times), -2 * np.sin(2 * times)], axis=1)
    np.testing.assert_allclose(run.at(times), exact, atol=1e-9)


def test_derivatives_of_an_oscillation_without_constraints():
    """The matrix of the flow of an oscillator, to 1e-9."""
    found = jax.jacfwd(lambda x: flow(Oscillator(), x, 0.0, 1.0).state)(
        jnp.array([0.3, -0.2])
    )
    c, s = np.cos(2.0), np.sin(2.0)
    np.testing.assert_allclose(found, [[c, s / 2], [-2 * s, c]], atol=1e-9)


def test_the_shipped_pendulum_can_be_simulated():
    """A small oscillation about the position at rest, to 1e-6."""
    system = read_setup(PENDULUM / "rig.toml").model.system
    start = [float(system.hanging) + 1e-3, 0.0]
    run = jaxcam.simulate(system, start, 0.0, 1.0)
    assert run.successful
    exact = 1e-3 * np.cos(np.sqrt(float(system.stiffness)))
    assert float(run.final[0] - system.hanging) == pytest.approx(exact, abs=1e-6)


@pytest.mark.parametrize("start", [0.0, 1e-9])
def test_a_rotor_that_starts_where_the_gradient_of_its_gap_vanishes(start):
    """From rest at the centre, x = t sin(t) / 2 and y = (sin(t) - t cos(t)) / 2, and
    the first impact is known to 1e-8 s.
    """

    def clearance(t):
        x, y = t * np.sin(t) / 2, (np.sin(t) - t * np.cos(t)) / 2
        return 1 - x**2 - y**2

    impact = brentq(clearance, 1.0, 3.0, xtol=1e-14)
    run = jaxcam.simulate(Rotor(), [start] * 4, 0.0, 2.5)
    assert run.successful, run.result
    assert float(run.impacts.time[0]) == pytest.approx(impact, abs=1e-8)


def test_a_gap_needs_an_impact_law():
    class Wall(Oscillator):
        def gap(self, t, state):
            return state[0]

    class Empty(Wall):
        def gap(self, t, state):
            return jnp.zeros((0,))

        def impact(self, t, state):
            return jnp.zeros((0, 2))

    assert missing_method(Oscillator) is None

    class Misspelled(Oscillator):
        constraint_names = ("left",)

        def gaps(self, t, state):
            return state[0]

    assert missing_method(Misspelled) == "gap"
    with pytest.raises(ValueError, match="Wall has constraints, but no impact; add"):
        jaxcam.simulate(Wall(), [1.0, 0.0], 0.0, 1.0)
    with pytest.raises(ValueError, match="leave out gap and impact"):
        jaxcam.simulate(Empty(), [1.0, 0.0], 0.0, 1.0)
