"""Select between scalars, and tuples of scalars, without branches."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp


def any_of(flags) -> Any:
    out = flags[0] if flags else jnp.asarray(False)
    for f in flags[1:]:
        out = out | f
    return out


def largest(values) -> Any:
    out = values[0]
    for v in values[1:]:
        out = jnp.maximum(out, v)
    return out


def select(condition, when_true, when_false) -> tuple:
    return tuple(
        jnp.where(condition, a, b) for a, b in zip(when_true, when_false, strict=True)
    )


def everywhere(condition, compute: Callable, otherwise) -> Any:
    """Return the result of `compute` where the condition holds, or `otherwise`; the
    result is computed for all batch elements.
    """
    pairs = compute(), otherwise
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), *pairs)


def where_needed(condition, compute: Callable, otherwise) -> Any:
    """As `everywhere`, but a compiled program with branches skips the computation if no
    batch element in a vector needs it.
    """
    arrays = jax.tree.map(jnp.asarray, otherwise)
    return jax.lax.cond(
        condition, lambda: jax.tree.map(jnp.asarray, compute()), lambda: arrays
    )


def of_constraint(values, constraint) -> Any:
    out = values[0]
    for k, v in enumerate(values[1:], start=1):
        out = jnp.where(constraint == k, v, out)
    return out
