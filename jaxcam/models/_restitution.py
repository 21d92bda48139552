"""Define laws of restitution: separation speed over approach speed of an impact."""

import equinox as eqx
import jax
import jax.numpy as jnp

from ._parameters import parameter
from ._units import rad_s_to_rpm


# Laws are called as `law(speed, approach_speed)`, with the speed of the drive (rad/s)
# and the magnitude of the normal velocity just before the impact, in the units of the
# gap per second. Any Module with this call is a law.


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
    """Restitution that grows linearly with the speed of the drive, limited to [0, 1].

    The thesis identifies such a law (section 4.6.1, Figure 4.15) but does not print it.
    It follows from its Table 5.2: free flight is conservative, hence the product of the
    two multipliers of an orbit with one impact per period is r^2. The defaults are the
    line through the ten values of r found in this manner, rounded (which changes r by
    5e-7).

    Examples:
        >>> from jaxcam.models import LinearInSpeed
        >>> float(LinearInSpeed(slope=0.01, intercept=0.5)(10.0, 0.1))
        0.6
    """

    slope: jax.Array = parameter(rad_s_to_rpm(0.00795658))
    """Change of the coefficient per speed (s/rad)."""
    intercept: jax.Array = parameter(-0.62122908)
    """Value of the line at speed zero."""

    def __call__(self, speed, approach_speed) -> jax.Array:
        del approach_speed
        return jnp.clip(self.slope * speed + self.intercept, 0.0, 1.0)


class PowerLawRestitution(eqx.Module):
    """Restitution that falls with the approach speed: r = r0 (1 + v / v_ref)^-b.

    Examples:
        >>> from jaxcam.models import PowerLawRestitution
        >>> float(PowerLawRestitution(0.8, 1.0, 1.0)(10.0, 1.0))
        0.4
    """

    r0: jax.Array = parameter()
    """Coefficient of the slowest impacts, between 0 and 1."""
    reference_speed: jax.Array = parameter()
    """Approach speed at which the coefficient has fallen to r0 / 2^b, in units of the
    gap per second."""
    exponent: jax.Array = parameter()
    """Exponent b; zero makes the coefficient constant."""

    def __call__(self, speed, approach_speed) -> jax.Array:
        del speed
        # log1p keeps full accuracy for the slow impacts at the end of chatter
        fall = jnp.log1p(approach_speed / self.reference_speed)
        return self.r0 * jnp.exp(-self.exponent * fall)
