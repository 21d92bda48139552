"""Systems with more than one wall or mass, stated as a reader of the package would."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from jaxcam import HybridSystem


class BallBetweenWalls(HybridSystem):
    """A ball in a uniform field between walls at 0 and `width`; state (x, x')."""

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity")

    gravity: jax.Array
    width: jax.Array
    restitution: jax.Array

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity])

    def gap(self, t, state):
        return jnp.stack([state[0], self.width - state[0]])

    def impact(self, t, state):
        after = jnp.stack([state[0], -self.restitution * state[1]])
        return jnp.stack([after, after])


class TwoMasses(HybridSystem):
    """A chain of two unit masses, springs and dampers, forced, mass 1 against a stop.

    State (x1, x2, x1', x2'); the stop is at x1 = `stop`. Two masses with stops are
    studied by Wagg (Chaos, Solitons and Fractals 22, 2004).
    """

    state_names: ClassVar[tuple[str, ...]] = ("x1", "x2", "v1", "v2")

    omega: jax.Array
    stop: jax.Array
    restitution: jax.Array
    force: jax.Array
    stiffness: jax.Array
    damping: jax.Array

    def vector_field(self, t, state):
        x1, x2, v1, v2 = state
        push = self.stiffness * (x2 - x1) + self.damping * (v2 - v1)
        drive = self.force * jnp.cos(self.omega * t)
        a1 = drive + push - self.stiffness * x1 - self.damping * v1
        a2 = drive - push
        return jnp.stack([v1, v2, a1, a2])

    def gap(self, t, state):
        return self.stop - state[0]

    def impact(self, t, state):
        return state.at[2].multiply(-self.restitution)

    @property
    def period(self):
        return 2 * jnp.pi / self.omega


class TwoStops(TwoMasses):
    """The same chain with a stop for each mass, both at `stop`."""

    def gap(self, t, state):
        return self.stop - state[:2]

    def impact(self, t, state):
        return jnp.stack(
            [
                state.at[2].multiply(-self.restitution),
                state.at[3].multiply(-self.restitution),
            ]
        )


def parameters(**values):
    """Plain numbers as arrays, so that one compiled program serves them all."""
    return {name: jnp.asarray(value, jnp.float64) for name, value in values.items()}


class DampedImpactOscillator(HybridSystem):
    """x'' + damping x' + stiffness x = amplitude cos(omega t), x <= wall; v+ = -e v-.

    State (x, x').
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity")

    omega: jax.Array
    damping: jax.Array
    stiffness: jax.Array
    amplitude: jax.Array
    wall: jax.Array
    restitution: jax.Array

    def vector_field(self, t, state):
        drive = self.amplitude * jnp.cos(self.omega * t)
        pull = self.stiffness * state[0] + self.damping * state[1]
        return jnp.stack([state[1], drive - pull])

    def gap(self, t, state):
        return self.wall - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])

    @property
    def period(self):
        return 2 * jnp.pi / self.omega


class InUnits(HybridSystem):
    """A system whose states and times are measured in other units, from `origin`."""

    system: HybridSystem
    units: jax.Array
    length: jax.Array
    time: jax.Array
    origin: jax.Array

    def _plain(self, t, state):
        return t / self.time, (state - self.origin) / self.units

    def vector_field(self, t, state):
        return self.units * self.system.vector_field(*self._plain(t, state)) / self.time

    def gap(self, t, state):
        return self.length * self.system.gap(*self._plain(t, state))

    def impact(self, t, state):
        after = self.system.impact(*self._plain(t, state))
        shape = (1,) * (after.ndim - 1) + state.shape
        return self.units.reshape(shape) * after + self.origin.reshape(shape)

    @property
    def period(self):
        period = self.system.period
        return None if period is None else period * self.time
