"""The phase of a drive without an encoder is that of the forcing."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.discrepancy.terms import system_with_terms
from jaxcam.hybrid import HybridSystem
from jaxcam.models import BouncingBall


class Shaken(HybridSystem):
    """A mass above a table whose forcing has a phase of either sign."""

    phase: float = 0.4
    frequency: float = 3.0
    sense: int = 1
    delayed: float = 0.0

    def _angle(self, t):
        return 2 * jnp.pi * self.frequency * t + self.sense * self.phase

    def vector_field(self, t, state):
        force = self.delayed * jnp.cos(2 * jnp.pi * self.frequency * t)
        return jnp.stack([state[1], force - 9.81])

    def gap(self, t, state):
        return state[0] - 0.01 * jnp.cos(self._angle(t))

    def impact(self, t, state):
        return jnp.stack([state[0], -0.8 * state[1]])

    @property
    def period(self):
        return 1 / self.frequency


@pytest.mark.parametrize("sense", [1, -1])
def test_the_angle_contains_the_phase_of_the_forcing(sense):
    """To 1e-14, with the sign that the system gives it."""
    system = system_with_terms(Shaken(sense=sense), (), state=[0.1, 0.2])
    motion = system.motion(0.2, jnp.zeros(2))
    expected = 2 * np.pi * 3.0 * 0.2 + sense * 0.4
    np.testing.assert_allclose(motion.phase, expected, rtol=1e-14)


class Named(Shaken):
    """A system whose `phase` is not a number."""

    phase: str = "of the table"
    sense: int = 0

    def _angle(self, t):
        return 2 * jnp.pi * self.frequency * t


@pytest.mark.parametrize("system", [Shaken(delayed=1.0), Named(), BouncingBall()])
def test_a_phase_that_does_not_shift_the_whole_forcing_is_not_used(system):
    """A part of the forcing has another phase; a ball has none."""
    assert system_with_terms(system, (), state=[0.1, 0.2]).sense == 0
