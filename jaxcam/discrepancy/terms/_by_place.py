"""Dry friction that varies with speed (Stribeck) or with position."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ._scaled import ScaledTerm
from ._term import Motion, strength


# Stribeck speeds to try, as fractions of the highest speed
_SHARES = tuple(np.geomspace(0.02, 0.6, 9).tolist())


class StribeckCurve(ScaledTerm):
    """Dry friction that is larger near standstill, `-se exp(-(v / vs)^2) sign(v)`.

    The speed `vs` is fitted together with the strength.
    """

    name: ClassVar[str] = "stribeck_curve"
    sentence: ClassVar[str] = "friction that is larger at low speed (Stribeck)"
    region: ClassVar[str] = "in flight, near standstill"
    source: ClassVar[str] = (
        "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 1994"
    )
    corner: ClassVar[bool] = True
    se: float = strength("[q]/s^2", 0.1, lower=0.0)
    vs: float = strength("[q]/s", 0.1, default=1.0, inner=True)

    def acceleration(self, motion: Motion):
        slow = jnp.exp(-((motion.velocity / self.vs) ** 2))
        return -self.se * slow * jnp.tanh(motion.velocity / self.scales.slip)

    def starts(self):
        return tuple({"vs": share * self.scales.fast} for share in _SHARES)

    def _sizes(self):
        return {"se": self.scales.push, "vs": 0.05 * self.scales.fast}

    def _ends(self):
        fast = self.scales.fast
        return {"vs": (2 * self.scales.slip, max(fast, 3 * self.scales.slip))}


class UnevenFriction(ScaledTerm):
    """Dry friction that varies with position, `-(u1 p + u2 p^2) sign(v)`.

    The variable `p` runs from -1 to 1 over the positions visited.
    """

    name: ClassVar[str] = "uneven_friction"
    sentence: ClassVar[str] = "dry friction that varies with position"
    region: ClassVar[str] = "in flight, as a function of position"
    source: ClassVar[str] = "Armstrong-Helouvry 1991, chapter 4"
    corner: ClassVar[bool] = True
    u1: float = strength("[q]/s^2", 0.1)
    u2: float = strength("[q]/s^2", 0.1)

    def acceleration(self, motion: Motion):
        place = (motion.position - self.scales.middle) / self.scales.half
        size = place * (self.u1 + place * self.u2)
        return -size * jnp.tanh(motion.velocity / self.scales.slip)

    def _sizes(self):
        return {"u1": self.scales.push, "u2": self.scales.push}
