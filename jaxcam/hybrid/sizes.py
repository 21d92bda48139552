"""How large each component of a motion is, for comparisons that know no units."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..parameters import as_arrays
from ._system import HybridSystem


def component_sizes(
    system: HybridSystem,
    t: Float[ArrayLike, ""],
    state: Float[ArrayLike, " n"],
    period: Float[ArrayLike, ""],
) -> Float[Array, " n"]:
    """What differences of two states are small or large beside, in the states' units.

    The size of each component, and of what its rate in free flight moves it by in
    period / (2 pi): the amplitude of a harmonic motion, at whichever phase it is seen.

    **Arguments:** time (s), state `(n,)`, and the period of the motion (s).

    **Returns:** shape `(n,)`.
    """
    numbers = (jnp.asarray(x, dtype=jnp.float64) for x in (t, state, period))
    return _sizes(as_arrays(system), *numbers)


@eqx.filter_jit
def _sizes(system, t, state, period):
    rates = system.vector_field(t, state)
    return jnp.abs(state) + period / (2 * jnp.pi) * jnp.abs(rates)
