"""The random systems as a user of jaxcam would define them."""

import jax
import jax.numpy as jnp

from jaxcam.hybrid import SwitchedSystem


class Machine(SwitchedSystem):
    """Masses between springs, with dry friction, then soft stops.

    The surfaces are the slip velocities `slips @ v - belts`, then the depths
    `normals @ q - levels` of the soft stops.
    """

    mass: jax.Array
    stiffness: jax.Array
    damping: jax.Array
    weight: jax.Array
    drive: jax.Array
    omega: jax.Array
    phase: jax.Array
    # friction forces, whose loads vary by the fraction `sway`
    slips: jax.Array
    belts: jax.Array
    friction: jax.Array
    sway: jax.Array
    static: jax.Array
    # springs and dampers of the stops, and their force at zero depth
    normals: jax.Array
    levels: jax.Array
    springs: jax.Array
    dampers: jax.Array
    preload: jax.Array

    def switching(self, t, state):
        d = self.mass.shape[0]
        slips = self.slips @ state[d:] - self.belts
        return jnp.concatenate([slips, self.normals @ state[:d] - self.levels])

    def branch(self, t, state, sides):
        d, f = self.mass.shape[0], self.friction.shape[0]
        q, v = state[:d], state[d:]
        turn = jnp.cos(self.omega * t + self.phase)
        force = self.weight + self.drive * turn - self.stiffness @ q - self.damping @ v
        rubbing = self.friction * (1 + self.sway * turn) * sides[:f]
        force = force - self.slips.T @ rubbing
        depth, rate = self.normals @ q - self.levels, self.normals @ v
        pressed = self.springs * depth + self.dampers * rate + self.preload
        pressed = jnp.where(sides[f:] > 0, pressed, 0.0)
        return jnp.concatenate([v, (force - self.normals.T @ pressed) / self.mass])

    @property
    def holding(self):
        return jnp.concatenate([self.static, jnp.ones(self.levels.shape[0])])

    @property
    def period(self):
        return 2 * jnp.pi / self.omega


class Walled(Machine):
    """A `Machine` with a wall that the first mass hits."""

    wall: jax.Array
    restitution: jax.Array

    def gap(self, t, state):
        return self.wall - state[0]

    def impact(self, t, state):
        return state.at[self.mass.shape[0]].multiply(-self.restitution)


class Relay(SwitchedSystem):
    """A linear system with relays, with hysteresis or without."""

    matrix: jax.Array
    force: jax.Array
    drive: jax.Array
    omega: jax.Array
    phase: jax.Array
    pushes: jax.Array
    normals: jax.Array
    levels: jax.Array
    width: jax.Array

    def switching(self, t, state):
        return self.normals @ state - self.levels

    def branch(self, t, state, sides):
        turn = jnp.cos(self.omega * t + self.phase)
        return (
            self.matrix @ state + self.force + self.drive * turn + sides @ self.pushes
        )

    @property
    def hysteresis(self):
        return self.width

    @property
    def period(self):
        return 2 * jnp.pi / self.omega


class Shaken(SwitchedSystem):
    """A block on a shaken plane, between springs, with friction in its contact.

    The state is (position, height, and their velocities) relative to the plane.
    """

    # accelerations along the plane and normal to it: gravity, and amplitude of shaking
    gravity: jax.Array
    shaking: jax.Array
    omega: jax.Array
    phase: jax.Array
    # spring along the plane, its force normal to the plane, and damping
    spring: jax.Array
    oblique: jax.Array
    damping: jax.Array
    mu: jax.Array
    static: jax.Array
    restitution: jax.Array

    def switching(self, t, state):
        return state[2]

    def branch(self, t, state, sides):
        pull = self.gravity + self.shaking * jnp.cos(self.omega * t + self.phase)
        along = pull[0] - self.spring * state[0] - self.damping * state[2]
        return jnp.stack([state[2], state[3], along, pull[1] + self.oblique * state[0]])

    def contact_friction(self, t, state, sides):
        return jnp.zeros_like(state).at[2].set(-self.mu * sides[0])

    def gap(self, t, state):
        return state[1]

    def impact(self, t, state):
        return state.at[3].multiply(-self.restitution)

    @property
    def holding(self):
        return self.static

    @property
    def period(self):
        return 2 * jnp.pi / self.omega
