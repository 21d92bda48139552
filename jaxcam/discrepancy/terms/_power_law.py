"""A coefficient of restitution that is a power of the approach speed."""

from typing import ClassVar

import jax.numpy as jnp

from ._scaled import ScaledTerm
from ._term import Motion, strength
from ._where import Where


# Lower limit of the approach speed, as a fraction of the highest speed
_SLOWEST = 1e-3


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
