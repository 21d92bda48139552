"""Restitution laws: the ratio of separation speed to approach speed of an impact."""

import equinox as eqx
import jax
import jax.numpy as jnp

from ._parameters import parameter
from ._units import rad_s_to_rpm


# Laws are called as `law(speed, approach_speed)`, with the speed of the drive (rad/s)
# and the magnitude of the normal velocity just before the impact, in the units of the
# gap per second. Any module that can be called in this way is a law.


class ConstantRestitution(eqx.Module):
    """Constant coefficient of restitution.

    Examples:
        >>> from jaxcam.models import ConstantRestitution
        >>> float(ConstantRestitution(0.8)(10.0, 0.5))
        0.8
    """

    r: jax.Array = parameter()
    """Coefficient of restitution, between 0 and 1."""

    def __call__(self, speed, approach_speed) -> jax.Array:
        del speed, approach_speed
        return self.r


class LinearInSpeed(eqx.Module):
    """Coefficient of restitution linear in the drive speed, limited to [0, 1].

    The thesis identifies such a law (section 4.6.1, Figure 4.15) but does not give its
    coefficients. They follow from Table 5.2 of the thesis: because free flight is
    conservative, the product of the two multipliers of an orbit with one impact per
    period is r^2. The defaults are the line through the ten values of r obtained in
    this way, rounded (which changes r by 5e-7).

    Examples:
        >>> from jaxcam.models import LinearInSpeed
        >>> float(LinearInSpeed(slope=0.01, intercept=0.5)(10.0, 0.1))
        0.6
    """

    slope: jax.Array = parameter(rad_s_to_rpm(0.00795658))
    """Slope of the coefficient with respect to the speed (s/rad)."""
    intercept: jax.Array = parameter(-0.62122908)
    """Value of the line at zero speed."""

    def __call__(self, speed, approach_speed) -> jax.Array:
        del approach_speed
        return jnp.clip(self.slope * speed + self.intercept, 0.0, 1.0)


class PowerLawRestitution(eqx.Module):
    """Coefficient of restitution that decreases with approach speed: r = r0 (1 + v /
    v_ref)^-b.

    Examples:
        >>> from jaxcam.models import PowerLawRestitution
        >>> float(PowerLawRestitution(0.8, 1.0, 1.0)(10.0, 1.0))
        0.4
    """

    r0: jax.Array = parameter()
    """Coefficient r0 in the limit of slow impacts, between 0 and 1."""
    reference_speed: jax.Array = parameter()
    """Approach speed v_ref at which the coefficient is r0 / 2^b, in units of the gap
    per second.
    """
    exponent: jax.Array = parameter()
    """Exponent b; zero makes the coefficient constant."""

    def __call__(self, speed, approach_speed) -> jax.Array:
        del speed
        # log1p keeps full accuracy for the slow impacts at the end of chatter
        fall = jnp.log1p(approach_speed / self.reference_speed)
        return self.r0 * jnp.exp(-self.exponent * fall)
