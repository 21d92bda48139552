"""Store and check parameters of models."""

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer

from ..parameters import real_array


def as_parameter(value) -> jax.Array:
    """Convert a number, list or traced value to a floating-point array."""
    return real_array(value, "a parameter")


def parameter(default=None):
    """Declare a floating-point field; without a default, a value must be given."""
    if default is None:
        return eqx.field(converter=as_parameter)
    return eqx.field(default=default, converter=as_parameter)


def is_concrete(*values) -> bool:
    """Return whether all values are known, that is, not traced by `jax.jit`."""
    return not any(isinstance(value, Tracer) for value in values)


def require_finite(**values) -> None:
    for name, value in values.items():
        if not np.all(np.isfinite(value)):
            raise ValueError(f"Give a finite number for `{name}`; it is {value}.")


def require_positive(**values) -> None:
    require_finite(**values)
    for name, value in values.items():
        if not np.all(np.asarray(value) > 0):
            raise ValueError(f"Give a positive number for `{name}`; it is {value}.")


def require_not_negative(**values) -> None:
    require_finite(**values)
    for name, value in values.items():
        if not np.all(np.asarray(value) >= 0):
            raise ValueError(f"Give a non-negative number for `{name}`; it is {value}.")


def require_restitution(value, where: str = "") -> None:
    """Raise `ValueError` for a coefficient of restitution outside [0, 1]."""
    if not np.all((np.asarray(value) >= 0) & (np.asarray(value) <= 1)):
        raise ValueError(
            "Choose a coefficient of restitution between 0 and 1; it is "
            f"{value}{where}."
        )
