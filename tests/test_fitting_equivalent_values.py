"""Of several equivalent solutions, a fit returns the one near the nominal values."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.fitting import fit, Model, Parameter, Problem, Sensor
from jaxcam.recordings import Recording, segment


TRUTH = {"amplitude": 0.4, "phase": (0.7, -2.0)}
SPEED, NOISE = 9.0, 1e-4


class Shaken(HybridSystem):
    """A free mass with a harmonic force."""

    amplitude: float = 0.41
    phase: float = 0.0
    angle: float = 0.5

    def vector_field(self, t, state):
        force = self.amplitude * jnp.cos(SPEED * t + self.phase)
        return jnp.stack([state[1], force - 20 * state[0] * self.angle])

    def gap(self, t, state):
        return jnp.ones_like(t)

    def impact(self, t, state):
        return state


@pytest.fixture(scope="module")
def problem():
    """Two recordings of steady oscillations with known amplitude and phases."""
    rng, time = np.random.default_rng(1), 2e-3 * np.arange(600)
    parts = []
    for name, phase in zip("ab", TRUTH["phase"], strict=True):
        x = TRUTH["amplitude"] * np.cos(SPEED * time + phase) / (10 - SPEED**2)
        noisy = x + NOISE * rng.standard_normal(len(time))
        run = Recording(name, time, {"x_m": noisy})
        parts.append(segment(run, "x_m", None, noise=NOISE))
    parameters = [
        Parameter("amplitude", lambda m: m.system.amplitude, 0.04),
        Parameter("phase", lambda m: m.system.phase, 3.2, per_record=True, unit="rad"),
        # in radians, but no angle of which a full turn makes no difference
        Parameter("angle", lambda m: m.system.angle, 0.1, unit="rad"),
    ]
    return Problem.build(
        Model(Shaken(), {"x_m": Sensor(0, noise=NOISE)}), parts, parameters
    )


def test_bounds_are_respected(problem):
    """A phase between 0 and 2 pi is not moved below 0, although this would be nearer to
    the nominal value.
    """
    phase = dataclasses.replace(problem.parameters[1], lower=0.0, upper=2 * np.pi)
    parameters = (problem.parameters[0], phase, problem.parameters[2])
    bounded = dataclasses.replace(problem, parameters=parameters)
    values = np.array(problem.start.values)
    values[:, 0], values[:, 1] = 0.4, np.mod(TRUTH["phase"], 2 * np.pi)
    point = problem.start._replace(values=jnp.asarray(values))
    found = fit(bounded, start=point)
    assert found.converged
    phases = [one.value for one in found.estimates if one.name == "phase"]
    np.testing.assert_allclose(phases, np.mod(TRUTH["phase"], 2 * np.pi), atol=1e-2)


def test_a_stopped_fit_is_not_continued(problem):
    """`stop` is called once, and the values are not moved."""
    values = np.array(problem.start.values)
    values[:, 1] = np.array(TRUTH["phase"]) + 2 * np.pi + 0.05
    point, calls = problem.start._replace(values=jnp.asarray(values)), []
    found = fit(problem, start=point, stop=lambda costs: not calls.append(costs))
    assert len(calls) == 1
    assert not found.converged
    assert all(one.value > 3 for one in found.estimates if one.name == "phase")


@pytest.mark.parametrize("prior", [False, True])
@pytest.mark.parametrize(("sign", "turns"), [(1, 0), (1, 3), (-1, -2)])
def test_the_solution_near_the_nominal_values_is_returned(problem, sign, turns, prior):
    """With a sign that a shift of the phase by half a turn undoes, and with additional
    turns, a fit ends within four standard errors of the true values, not of the
    equivalent ones."""
    shift = 2 * np.pi * turns + (np.pi if sign < 0 else 0.0)
    values = np.array(problem.start.values)
    values[:, 0] = 0.4 * sign
    values[:, 1] = np.array(TRUTH["phase"]) + shift
    point = problem.start._replace(values=jnp.asarray(values))
    found = fit(problem, start=point, prior=prior)
    assert found.converged
    truth = [TRUTH["amplitude"], *TRUTH["phase"], 0.5]
    for one, value in zip(found.estimates, truth, strict=True):
        assert abs(one.value - value) < 4 * one.stderr
