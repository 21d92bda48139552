"""Move a state onto the constraints with which it is in contact."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._normal import gaps, normal_velocity


# Newton steps; the first one leaves the square of the distance, relative to the radius
# of curvature of the constraint
_STEPS = 5
# Relative regularisation: redundant constraints have dependent gradients
_LEAST = 1e-14


def onto_contacts(
    system: HybridSystem,
    t: RealScalar,
    x: State,
    held: tuple[int, ...],
    scale: Float[Array, " n"],
) -> State:
    """Return the nearest state at which the gaps and normal velocities of some
    constraints are zero.

    Args:
        system: The system.
        t: Time (s).
        x: State near these constraints, shape `(n,)`.
        held: Indices of the constraints.
        scale: Scales of the components, which define the distance, shape `(n,)`.

    Returns:
        The state, shape `(n,)`; differentiable in all arguments.

    Examples:
        >>> from jaxcam.hybrid.surface import onto_contacts
        >>> from jaxcam.models import BouncingBall
        >>> near = jnp.array([0.01, -0.02])
        >>> onto_contacts(BouncingBall(), 0.0, near, (0,), jnp.ones(2)).tolist()
        [0.0, 0.0]
    """
    rows = jnp.array(held)

    def conditions(y):
        closed = gaps(system, t, y)[rows], normal_velocity(system, t, y)[rows]
        return jnp.concatenate(closed)

    for _ in range(_STEPS):
        missed, slopes = conditions(x), jax.jacfwd(conditions)(x) * scale[None]
        # rows of unit length: gaps and velocities have different units
        sizes = jnp.sqrt(jnp.sum(slopes**2, axis=1))
        sizes = jnp.where(sizes > 0, sizes, 1.0)
        slopes, missed = slopes / sizes[:, None], missed / sizes
        inside = slopes @ slopes.T + _LEAST * jnp.eye(len(missed))
        x = x - scale * (slopes.T @ jnp.linalg.solve(inside, missed))
    return x
