"""Orbits by single shooting, evaluated outside of traced programs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import continuation
from continuation._context import Context
from continuation._program import correct
from jaxcam.hybrid import Settings, SwitchedSystem
from jaxcam.hybrid.flow_jacobian import runs_by_llvm


class _Relay(SwitchedSystem):
    """A relay with hysteresis: the state does not tell which branch is active."""

    push: float = 1.0
    omega: float = 2 * np.pi / 0.3

    @property
    def hysteresis(self):
        return 0.5

    @property
    def period(self):
        return 2 * jnp.pi / self.omega

    def switching(self, t, state):
        return state[0]

    def branch(self, t, state, sides):
        return jnp.stack([0.1 * jnp.cos(self.omega * t) - self.push * sides[0]])

    def gap(self, t, state):
        return jnp.zeros(0)

    def impact(self, t, state):
        return jnp.zeros((0, 1))


class _Stop(SwitchedSystem):
    """A forced mass with dry friction in front of a stop."""

    stop: float = 2.0

    @property
    def period(self):
        return jnp.asarray(2 * jnp.pi / 0.7)

    def switching(self, t, state):
        return state[1]

    def branch(self, t, state, sides):
        push = 0.9 * jnp.cos(0.7 * t) - 0.1 * sides[0]
        return jnp.stack([state[1], push - state[0] - 0.1 * state[1]])

    def gap(self, t, state):
        return self.stop - state[0]

    def impact(self, t, state):
        return state.at[1].multiply(-0.6)


def _problem(system, x, periods, **settings):
    return continuation.SingleShooting(
        system,
        jnp.zeros(()),
        jnp.asarray(x),
        jnp.ones(len(x)),
        Settings(tolerance=1e-10, **settings),
        periods,
    )


def test_the_evaluation_is_that_of_a_traced_program():
    """All quantities of six forcing periods with hysteresis, to 1e-9."""
    problem = _problem(_Relay(), [0.3], 6)
    z = np.array([0.3, 1.0])
    made = problem.evaluated_on_host(0, z)
    assert made is not None

    @jax.jit
    def traced(u, p):
        return problem.evaluated(u, p, lambda p: _Relay(push=p))

    expected = traced(jnp.asarray(z[:1]), jnp.asarray(z[1]))
    pairs = zip(jax.tree.leaves(made), jax.tree.leaves(expected), strict=True)
    for one, other in pairs:
        np.testing.assert_allclose(one, other, atol=1e-9)
    # the state has both signs of its rate at the same place: chained runs would differ
    assert np.min(made.observed["stroboscopic"]) < -0.35


@pytest.mark.parametrize("periods", [1, 2])
def test_a_motion_that_fails_is_no_success(periods):
    """A guess beyond the stop: no error, and no solution."""
    problem = _problem(_Stop(), [2.5, 0.0], periods)
    context = Context(0, 0.2, continuation.BranchSettings())
    z = np.array([2.5, 0.0, 2.0])
    direction = np.array([0.0, 0.0, 1.0])
    at = correct(problem, context, z, direction, direction)
    assert not at.success
    assert np.all(np.isnan(at.observed["stroboscopic"]))


def test_the_backend_is_not_used_inside_transformations():
    def run(value):
        return runs_by_llvm(Settings(), value, lambda: 1.0)

    assert run(1.0) == 1.0
    assert runs_by_llvm(Settings(backend="xla"), 1.0, lambda: 1.0) is None
    seen = []
    jax.jit(lambda v: seen.append(run(v)) or v)(1.0)
    jax.vmap(lambda v: seen.append(run(2.0)) or v)(jnp.ones(2))
    assert seen == [None, None]
