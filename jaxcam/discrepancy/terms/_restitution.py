"""Coefficients of restitution that depend on the approach speed."""

from typing import ClassVar

import jax.numpy as jnp

from ...recordings import References
from ._scaled import ScaledTerm
from ._term import constant, Motion, strength, Term
from ._where import Where


# Lower limit of the approach speed, as a fraction of the highest speed
_SLOWEST = 1e-3


class RestitutionVelocity(Term):
    """Coefficient of restitution that decreases with approach speed v,
    `r0 (1 + v / reference)^-rb`.
    """

    name: ClassVar[str] = "restitution_velocity"
    sentence: ClassVar[str] = (
        "a coefficient of restitution that depends on the approach speed"
    )
    where: ClassVar[str] = Where.IMPACT
    region: ClassVar[str] = "at impacts, as a function of approach speed"
    source: ClassVar[str] = "Goldsmith, Impact, 1960, chapter 8; Johnson 1985, 11.5"
    reference_speed: ClassVar[str] = "impact_speed"
    rb: float = strength("-", 0.02, lower=0.0)
    reference: float = constant(References.impact_speed)

    def described(self) -> str:
        speed = f"{float(self.reference):.4g} {self.written('[q]/s')}"
        return f"{self.region} v, in proportion to (1 + v/v0)^-rb with v0 = {speed}"

    def restitution(self, approach, motion: Motion):
        del motion
        return jnp.exp(-self.rb * jnp.log1p(approach / self.reference))


class RestitutionPower(ScaledTerm):
    """Coefficient of restitution as a power of the approach speed, `r0 (v/v0)^-rp`.

    It decreases with speed for a positive `rp`, as in plastic impacts, and increases
    for a negative one; `v0` is a speed rarely exceeded in the recordings.
    """

    name: ClassVar[str] = "restitution_power"
    sentence: ClassVar[str] = (
        "a coefficient of restitution that is a power of the approach speed"
    )
    where: ClassVar[str] = Where.IMPACT
    region: ClassVar[str] = "at impacts, as a function of approach speed"
    source: ClassVar[str] = "Johnson, Contact Mechanics, 1985, section 11.5"
    rp: float = strength("-", 0.05)

    def restitution(self, approach, motion: Motion):
        del motion
        share = jnp.maximum(approach / self.scales.fast, _SLOWEST)
        return jnp.exp(-self.rp * jnp.log(share))
