"""Find the parameter values at which the interrupted sequence loses an impact."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.parameters import Where

from ._chatter_orbit import prepared_orbit
from ._interruption import Line, line
from ._scalar import check_chatter_system


def adding_thresholds(
    system: HybridSystem, where: Where, interruption, beyond, count: int = 8
) -> Float[Array, " count"]:
    """Return the parameter values at which the orbit that starts at release grazes and
    loses an impact.

    Beyond the interruption, the motion that starts at release has finitely many impacts
    before the next release. The number of impacts falls by one where one of them
    grazes. The parameter values at which this happens converge geometrically to the
    interruption, with the ratio q of [`variational.scaling_law`][].

    Args:
        system: As in [`variational.chatter_interruption`][].
        where: As in [`variational.chatter_interruption`][].
        interruption: The parameter value at which complete chatter ends.
        beyond: A value on the interrupted side; thresholds between this value and
            `interruption` are found.
        count: Number of thresholds.

    Returns:
        The values in the unit of the parameter, in order of decreasing distance from
        `interruption`, shape `(count,)`.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import adding_thresholds
        >>> system = ImpactOscillator(omega=1.0, restitution=0.5)
        >>> adding_thresholds(system, "omega", 0.6071945, 0.8, count=2).shape
        (2,)
    """
    check_chatter_system(system)
    along = line(system, where)
    near = jnp.asarray(interruption, jnp.float64)
    far = jnp.asarray(beyond, jnp.float64)
    fewest = _impacts(along, far)
    return _thresholds(along, near, far, fewest + jnp.arange(1, count + 1))


@program
def _impacts(along: Line, value):
    return prepared_orbit(along.at(value).prepared(), 0.0).impacts


@program
def _thresholds(along: Line, near, far, numbers):
    """Bisect on the number of impacts, which decreases away from the interruption."""

    def one(number):
        def halve(carry):
            near, far, _ = carry
            middle = 0.5 * (near + far)
            orbit = prepared_orbit(along.at(middle).prepared(), 0.0)
            more = orbit.complete | (orbit.impacts >= number)
            near, far = jnp.where(more, middle, near), jnp.where(more, far, middle)
            return near, far, middle

        def wide(carry):
            near, far, middle = carry
            return jnp.abs(far - near) > 4e-16 * jnp.abs(middle)

        return jax.lax.while_loop(wide, halve, (near, far, near))[0]

    return jax.lax.map(one, numbers)
