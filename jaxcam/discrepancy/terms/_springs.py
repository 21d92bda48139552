"""Forces that depend on position: constant, linear, with a knee, or from a one-sided
stop.
"""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ._scaled import ScaledTerm
from ._term import Motion, strength


# Positions of a knee or an edge to try, as fractions of the range visited
_SHARES = tuple(np.linspace(0.02, 0.98, 33).tolist())
# Depth over which the dry friction of a stop sets in, as a fraction of half the range
_BEGINS = 0.02


class ConstantForce(ScaledTerm):
    """A constant force, such as weight: `f0`."""

    name: ClassVar[str] = "constant_force"
    sentence: ClassVar[str] = "a constant force"
    source: ClassVar[str] = "Meriam and Kraige, Dynamics, chapter 3"
    f0: float = strength("[q]/s^2", 0.1)

    def acceleration(self, motion: Motion):
        return self.f0 + 0.0 * motion.position

    def _sizes(self):
        return {"f0": self.scales.push}


class LinearSpring(ScaledTerm):
    """A spring about the middle of the range of positions, `-k1 (q - middle)`."""

    name: ClassVar[str] = "linear_spring"
    sentence: ClassVar[str] = "a force proportional to the deflection"
    region: ClassVar[str] = "in flight, as a function of position"
    source: ClassVar[str] = "Hooke 1678"
    k1: float = strength("1/s^2", 1.0, lower=0.0)

    def acceleration(self, motion: Motion):
        return -self.k1 * (motion.position - self.scales.middle)

    def _sizes(self):
        return {"k1": self.scales.push / self.scales.half}


class _WithEdge(ScaledTerm):
    """A force that acts only on one side of a position, its edge or knee.

    `viscous` strengths multiply a velocity; `dry` strengths are forces.
    """

    viscous: ClassVar[tuple[str, ...]] = ()
    dry: ClassVar[tuple[str, ...]] = ()

    def starts(self):
        low, width = self.scales.low, 2 * self.scales.half
        return tuple({self._edge: low + share * width} for share in _SHARES)

    @property
    def _edge(self) -> str:
        """Name of the inner parameter: the position of the edge or knee."""
        return next(one.name for one in self._declared() if one.inner)

    def _stiff(self) -> float:
        return self.scales.push / self.scales.half

    def _sizes(self):
        stiff, scales = self._stiff(), self.scales
        sizes = {one.name: stiff for one in self._declared()}
        sizes |= {name: stiff / scales.fast for name in self.viscous}
        sizes |= dict.fromkeys(self.dry, scales.push)
        return sizes | {self._edge: 0.05 * scales.half}

    def _ends(self):
        return {self._edge: (self.scales.low, self.scales.high)}


class BilinearSpring(_WithEdge):
    """A stiffness that changes at a knee, `-kb max(q - knee, 0)`."""

    name: ClassVar[str] = "bilinear_spring"
    sentence: ClassVar[str] = "a stiffness that changes at a certain position"
    region: ClassVar[str] = "in flight, beyond the knee"
    source: ClassVar[str] = "Shaw and Holmes, Journal of Sound and Vibration 1983"
    kb: float = strength("1/s^2", 1.0)
    knee: float = strength("[q]", 0.01, default=0.0, inner=True)

    def acceleration(self, motion: Motion):
        return -self.kb * jnp.maximum(motion.position - self.knee, 0.0)


class StopAbove(_WithEdge):
    """An elastic stop, with energy losses, that acts above an edge.

    At a depth `d = max(q - edge_a, 0)` the acceleration is `-d (ka + da v + la sign(v))
    - ra sign(v)`. The coefficients describe stiffness, viscous damping, a
    rate-independent loss as in rubber, and dry friction. Beyond the edge, the friction
    reaches its full value within about a hundredth of the range of positions.
    """

    name: ClassVar[str] = "stop_above"
    sentence: ClassVar[str] = "an elastic stop above an edge"
    region: ClassVar[str] = "in flight, above the edge"
    source: ClassVar[str] = "Hunt and Crossley, Journal of Applied Mechanics 1975"
    viscous: ClassVar[tuple[str, ...]] = ("da",)
    dry: ClassVar[tuple[str, ...]] = ("ra",)
    ka: float = strength("1/s^2", 1.0, lower=0.0)
    da: float = strength("1/(s [q])", 1.0, lower=0.0)
    la: float = strength("1/s^2", 1.0, lower=0.0)
    ra: float = strength("[q]/s^2", 1.0, lower=0.0)
    edge_a: float = strength("[q]", 0.01, default=0.0, inner=True)

    def acceleration(self, motion: Motion):
        depth = jnp.maximum(motion.position - self.edge_a, 0.0)
        numbers = self.ka, self.da, self.la, self.ra
        return -_reaction(self, depth, motion.velocity, *numbers)


class StopBelow(_WithEdge):
    """An elastic stop, with energy losses, that acts below an edge.

    It is the mirror image of `StopAbove`, with the depth `d = max(edge_b - q, 0)` and
    the coefficients `kd`, `dd`, `ld` and `rd`.
    """

    name: ClassVar[str] = "stop_below"
    sentence: ClassVar[str] = "an elastic stop below an edge"
    region: ClassVar[str] = "in flight, below the edge"
    source: ClassVar[str] = "Hunt and Crossley, Journal of Applied Mechanics 1975"
    viscous: ClassVar[tuple[str, ...]] = ("dd",)
    dry: ClassVar[tuple[str, ...]] = ("rd",)
    kd: float = strength("1/s^2", 1.0, lower=0.0)
    dd: float = strength("1/(s [q])", 1.0, lower=0.0)
    ld: float = strength("1/s^2", 1.0, lower=0.0)
    rd: float = strength("[q]/s^2", 1.0, lower=0.0)
    edge_b: float = strength("[q]", 0.01, default=0.0, inner=True)

    def acceleration(self, motion: Motion):
        depth = jnp.maximum(self.edge_b - motion.position, 0.0)
        numbers = self.kd, self.dd, self.ld, self.rd
        return _reaction(self, depth, -motion.velocity, *numbers)


def _reaction(term: ScaledTerm, depth, velocity, stiffness, damping, loss, friction):
    """Return the force of a stop, given the depth and the velocity into the stop."""
    turned = jnp.tanh(velocity / term.scales.slip)
    touching = 1 - jnp.exp(-depth / (_BEGINS * term.scales.half))
    elastic = depth * (stiffness + damping * velocity + loss * turned)
    return elastic + touching * friction * turned
