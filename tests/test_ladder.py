"""A ladder that leans against a wall, with friction at both ends."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.hybrid import SwitchedSystem


INERTIA = 1 / 12


def _number(value) -> jax.Array:
    """A field that is an array, so that one program serves all values."""
    return eqx.field(converter=jnp.asarray, default=value)


class Ladder(SwitchedSystem):
    """Position of the centre and angle above the floor, and their rates; unit mass,
    length and gravity. The floor is y = 0; the wall x = 0, on the left.
    """

    mu_floor: jax.Array = _number(0.4)
    mu_wall: jax.Array = _number(0.3)

    def gap(self, t, state):
        c, s = jnp.cos(state[2]) / 2, jnp.sin(state[2]) / 2
        return jnp.stack([state[1] - s, state[0] - c])

    def _directions(self, state):
        """The changes of the rates by forces normal and tangential to floor and wall;
        they are the gradients of the normal and slip velocities, by unit mass.
        """
        c, s = jnp.cos(state[2]) / 2, jnp.sin(state[2]) / 2
        normal = jnp.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
        normal = normal.at[:, 2].set(jnp.stack([-c, s]))
        slip = jnp.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        return normal, slip.at[:, 2].set(jnp.stack([-s, c]))

    def switching(self, t, state):
        return self._directions(state)[1] @ state[3:]

    def branch(self, t, state, sides):
        return jnp.concatenate([state[3:], jnp.array([0.0, -1.0, 0.0])])

    def _per_impulse(self, state):
        """The changes of the rates by normal and by tangential impulses that change the
        normal velocity by one.
        """
        masses = jnp.array([[1.0, 1.0, 1 / INERTIA]])
        normal, slip = self._directions(state)
        mobility = jnp.sum(normal**2 * masses, axis=1)[:, None]
        return normal * masses / mobility, slip * masses / mobility

    def impact(self, t, state):
        speeds = self._directions(state)[0] @ state[3:]
        after = state[None, 3:] - speeds[:, None] * self._per_impulse(state)[0]
        return jnp.concatenate([jnp.tile(state[:3], (2, 1)), after], axis=1)

    def contact_friction(self, t, state, sides):
        limits = -jnp.stack([self.mu_floor, self.mu_wall]) * sides
        rates = limits[:, None] * self._per_impulse(state)[1]
        return jnp.concatenate([jnp.zeros((2, 3)), rates], axis=1)


@pytest.mark.parametrize(("floor", "wall"), [(0.4, 0.3), (0.3, 0.6), (0.5, 0.0)])
@pytest.mark.parametrize("more", [1e-6, -1e-6])
def test_a_ladder_slips_below_its_limit(floor, wall, more):
    """tan(angle) = (1 - floor wall) / (2 floor) at the limit, with both forces at the
    limit of friction; to 1e-6 rad.
    """
    angle = np.arctan((1 - floor * wall) / (2 * floor)) + more
    start = [np.cos(angle) / 2, np.sin(angle) / 2, angle, 0.0, 0.0, 0.0]
    run = jaxcam.simulate(Ladder(mu_floor=floor, mu_wall=wall), start, 0.0, 1.0)
    assert run.successful, run.result
    moved = abs(float(run.final[2]) - angle)
    assert moved < 1e-13 if more > 0 else moved > 1e-7
