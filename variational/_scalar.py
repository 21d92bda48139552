"""Systems of one constraint may state its gap as a scalar or as a vector of one."""

from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxcam import HybridSystem


_Module = TypeVar("_Module", bound=eqx.Module)


def as_arrays(system: _Module) -> _Module:
    """The system with its Python floats as arrays, so that they are parameters."""
    return jax.tree.map(
        lambda leaf: jnp.asarray(leaf) if type(leaf) is float else leaf, system
    )


def one_constraint(value, ndim: int):
    """`value` without the axis of constraints, if it has one."""
    return jnp.reshape(value, value.shape[-ndim:] if ndim else ())


def check_chatter_system(system: HybridSystem) -> None:
    """Raise `ValueError` where the theory of chattering needs a period."""
    if system.period is None:
        raise ValueError(
            "this system has no forcing period; chattering that ends at a release "
            "needs one"
        )


def gap_of(system: HybridSystem, time, state):
    """The gap of a system with one constraint, a scalar."""
    return one_constraint(system.gap(time, state), 0)
