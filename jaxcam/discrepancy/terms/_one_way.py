"""Friction that depends on the direction of motion."""

from typing import ClassVar

import jax.numpy as jnp

from ._scaled import ScaledTerm
from ._term import Motion, strength


_SOURCE = "Armstrong-Helouvry 1991, Control of Machines with Friction"


class DampingForwards(ScaledTerm):
    """Viscous damping for motion in the positive direction only, `-cf max(v, 0)`.

    If there is also damping in both directions, this is the excess in this direction.
    """

    name: ClassVar[str] = "damping_forwards"
    sentence: ClassVar[str] = "viscous damping that is larger at positive velocities"
    region: ClassVar[str] = "in flight, at positive velocities"
    source: ClassVar[str] = _SOURCE
    cf: float = strength("1/s", 0.1, lower=0.0)

    def acceleration(self, motion: Motion):
        return -self.cf * jnp.maximum(motion.velocity, 0.0)

    def _sizes(self):
        return {"cf": self.scales.push / self.scales.fast}


class DampingBackwards(ScaledTerm):
    """Viscous damping for motion in the negative direction only, `cb max(-v, 0)`."""

    name: ClassVar[str] = "damping_backwards"
    sentence: ClassVar[str] = "viscous damping that is larger at negative velocities"
    region: ClassVar[str] = "in flight, at negative velocities"
    source: ClassVar[str] = _SOURCE
    cb: float = strength("1/s", 0.1, lower=0.0)

    def acceleration(self, motion: Motion):
        return self.cb * jnp.maximum(-motion.velocity, 0.0)

    def _sizes(self):
        return {"cb": self.scales.push / self.scales.fast}


class FrictionForwards(ScaledTerm):
    """Dry friction for motion in the positive direction only, `-ff` for `v > 0`."""

    name: ClassVar[str] = "friction_forwards"
    sentence: ClassVar[str] = "dry friction that is larger at positive velocities"
    region: ClassVar[str] = "in flight, at positive velocities"
    source: ClassVar[str] = _SOURCE
    corner: ClassVar[bool] = True
    ff: float = strength("[q]/s^2", 0.1, lower=0.0)

    def acceleration(self, motion: Motion):
        forwards = (1 + jnp.tanh(motion.velocity / self.scales.slip)) / 2
        return -self.ff * forwards

    def _sizes(self):
        return {"ff": self.scales.push}


class FrictionBackwards(ScaledTerm):
    """Dry friction for motion in the negative direction only, `fb` for `v < 0`."""

    name: ClassVar[str] = "friction_backwards"
    sentence: ClassVar[str] = "dry friction that is larger at negative velocities"
    region: ClassVar[str] = "in flight, at negative velocities"
    source: ClassVar[str] = _SOURCE
    corner: ClassVar[bool] = True
    fb: float = strength("[q]/s^2", 0.1, lower=0.0)

    def acceleration(self, motion: Motion):
        backwards = (1 - jnp.tanh(motion.velocity / self.scales.slip)) / 2
        return self.fb * backwards

    def _sizes(self):
        return {"fb": self.scales.push}
