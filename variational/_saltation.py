"""The derivative of the flow across an impact."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem


def saltation_matrix(
    system: HybridSystem, t, state_before: Float[Array, " n"], constraint: int = 0
) -> Float[Array, "n n"]:
    """How a deviation just before an impact becomes one just after it.

    With F-, F+ the vector field before and after, R the impact law and H the gap,

        S = R_x + (F+ - R_t - R_x F-) H_x / (H_t + H_x F-),

    explicit time included, so that moving constraints need nothing extra.

    **Arguments:** the time of the impact (s), the state just before it, shape `(n,)`,
    with a normal velocity below zero, and which constraint is hit.

    **Returns:** shape `(n, n)`. Grows like one over the impact speed near grazing.
    """
    t = jnp.asarray(t, dtype=jnp.float64)
    state_before = jnp.asarray(state_before, dtype=jnp.float64)

    def gap(time, x):
        return jnp.atleast_1d(system.gap(time, x))[constraint]

    def impact(time, x):
        return jnp.atleast_2d(system.impact(time, x))[constraint]

    after = impact(t, state_before)
    flow_before = system.vector_field(t, state_before)
    flow_after = system.vector_field(t, after)
    law = jax.jacfwd(impact, argnums=1)(t, state_before)
    law_rate = jax.jacfwd(impact)(t, state_before)
    normal = jax.grad(gap, argnums=1)(t, state_before)
    speed = jax.grad(gap)(t, state_before) + normal @ flow_before
    moved = flow_after - law_rate - law @ flow_before
    return law + moved[:, None] * normal[None, :] / speed
