"""Integrate one free flight of known length, with a cheap derivative.

The event loop determines when a flight ends. Here, the duration is an unknown of the
equations, so a fixed number of Runge-Kutta steps suffices, and the end depends smoothly
on all variables even if the flight grazes or passes through a constraint.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.runge_kutta import DOPRI8, fixed_steps

from .._one_jacobian import with_one_jacobian


def flight_nodes(
    system: HybridSystem, t0, x0: Float[Array, " n"], t1, steps: int
) -> tuple[Float[Array, " steps"], Float[Array, "steps n"], Float[Array, ""]]:
    """Integrate free flight from `x0` at `t0` to `t1` (s) in equal eighth-order steps.

    Returns:
        The times and states at the ends of the steps, and the sum of the error
            estimates, relative to 1 + |x|.
    """
    field = system.prepared().vector_field
    times, states, errors = fixed_steps(DOPRI8, field, t0, x0, t1, steps)
    wrong = jnp.max(jnp.abs(errors) / (1.0 + jnp.abs(states)), axis=1)
    return times, states, jnp.sum(wrong)


def flight_end(system: HybridSystem, t0, x0, t1, *, steps: int) -> Float[Array, " n"]:
    """Return the state at `t1` (s) after free flight from `x0` at `t0`.

    Its forward derivative needs one small Jacobian per flight for any number of
    directions, and can be differentiated again.
    """
    return _end(system, t0, x0, t1, steps=steps)


@with_one_jacobian
def _end(system, t0, x0, t1, *, steps):
    return flight_nodes(system, t0, x0, t1, steps)[1][-1]
