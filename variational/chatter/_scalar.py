"""Handle single-constraint systems whose gap is a scalar or a vector of length one."""

import jax.numpy as jnp

from jaxcam import HybridSystem


def one_constraint(value, ndim: int):
    """Return `value` without its axis of constraints, if it has one."""
    return jnp.reshape(value, value.shape[-ndim:] if ndim else ())


def check_chatter_system(system: HybridSystem) -> None:
    """Raise `ValueError` for a system without the period that chatter theory needs."""
    if system.period is None:
        raise ValueError(
            "this system has no forcing period; give it a `period`, which is needed "
            "for chatter that ends at a release"
        )


def scalar_gap(system: HybridSystem, time, state):
    """Return the gap of a system with one constraint, a scalar."""
    return one_constraint(system.gap(time, state), 0)
