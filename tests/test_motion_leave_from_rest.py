"""A block that dry friction holds at a stop, and leaves it when the force has grown."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.hybrid import SwitchedSystem
from jaxcam.hybrid.record import SwitchKind


FORCE = 0.5


class Block(SwitchedSystem):
    """Position and velocity of a block with friction, forced by a cosine, at a stop."""

    friction: jax.Array = eqx.field(converter=jnp.asarray, default=0.3)
    restitution: jax.Array = eqx.field(converter=jnp.asarray, default=0.0)

    def switching(self, t, state):
        return state[1]

    def branch(self, t, state, sides):
        force = FORCE * jnp.cos(t) - self.friction * sides[0]
        return jnp.stack([state[1], force])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


@pytest.mark.parametrize("friction", [0.1, 0.15, 0.25, 0.275, 0.3, 0.35, 0.4, 0.425])
def test_the_block_leaves_where_the_force_exceeds_friction(friction):
    """The stop no longer pushes when the force on the block is zero; friction gives way
    where F cos(t) = friction. Times to 1e-9.
    """
    run = jaxcam.simulate(Block(friction), [0.02, 0.0], 0.0, 60.0)
    assert run.successful, run.result
    time, kind = np.asarray(run.switches.time), np.asarray(run.switches.kind)
    leaves = time[kind == SwitchKind.LEAVES]
    # away from the stop, also where F cos(t) = -friction
    at = (np.arccos(friction / FORCE) + leaves) % np.pi
    assert len(leaves) >= 1
    assert np.max(np.minimum(at, np.pi - at)) < 1e-9
    # it comes to rest at the stop a few times, not endlessly at one instant
    assert int(run.contacts.count) < 12
