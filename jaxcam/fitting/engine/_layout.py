"""A model as a function of the values of its parameters."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ...hybrid.programs import program
from ._model import Model


T = TypeVar("T")


def _as_it_is(model: Model) -> Model:
    return model


def strongly_typed(tree: T) -> T:
    """Return a tree whose arrays have no weak types.

    Arrays made of Python numbers are weakly typed, and JAX compiles a program of its
    own for them.
    """

    def one(leaf):
        if not getattr(leaf, "weak_type", False):
            return leaf
        return jax.lax.convert_element_type(leaf, leaf.dtype)

    return jax.tree.map(one, tree)


class Layout(eqx.Module):
    """The location of the parameters among the leaves of a model.

    `ready` precomputes the quantities that a model needs at every step. `apart` does
    the same without steps that several parameters share, which would hide on which of
    them a quantity depends.
    """

    model: Model
    """The model."""
    places: tuple[int, ...] = eqx.field(static=True)
    """Index of each parameter among the leaves."""
    ready: Callable[[Model], Model] = eqx.field(static=True, default=_as_it_is)
    """Prepares a model for many evaluations."""
    apart: Callable[[Model], Model] | None = eqx.field(static=True, default=None)
    """The same, with a separate computation for each part; default: `ready`."""

    def at(self, values: Float[Array, " q"]) -> Model:
        """Return the model with the given parameter values."""
        return self.placed([values[column] for column in range(len(self.places))])

    def placed(self, values: Sequence[Any]) -> Model:
        """Return the model with parameter values given as a sequence."""
        leaves, tree = jax.tree.flatten(self.model)
        for place, value in zip(self.places, values):
            leaves[place] = value
        return self.ready(jax.tree.unflatten(tree, leaves))

    @program
    def about(self, values: Float[Array, " q"]) -> "Expansion":
        """Return the first-order expansion of the model about parameter values."""
        origin = self.at(values)
        given = jax.tree.leaves(self.model)
        leaves, tree = jax.tree.flatten(origin)
        known = {id(leaf) for leaf in given}
        moving = [k for k, leaf in enumerate(leaves) if id(leaf) not in known]

        def pushed(unit):
            def moved(values):
                leaves = jax.tree.leaves(self.at(values))
                return [leaves[k] for k in moving]

            return jax.jvp(moved, (values,), (unit,))[1]

        rows = jax.vmap(pushed)(jnp.eye(len(values)))
        slopes: list[Any] = [None] * len(leaves)
        for k, row in zip(moving, rows):
            slopes[k] = row
        return Expansion(origin, tuple(slopes))


class Expansion(eqx.Module):
    """A first-order expansion of a model in its parameters.

    The quantities needed at every step are computed and differentiated once, instead of
    in each piece.

    - `slopes`: derivatives of each leaf, with one row per parameter; None if the leaf
        depends on no parameter.
    """

    model: Model
    slopes: tuple[Float[Array, "..."] | None, ...]

    def by(self, columns: Int[Array, " m"], scales: Float[Array, " m"]) -> "Expansion":
        """Return the expansion in some of the parameters, in units of their scales."""

        def rows(slope):
            return slope[columns] * scales.reshape(-1, *[1] * (slope.ndim - 1))

        slopes = tuple(None if s is None else rows(s) for s in self.slopes)
        return Expansion(self.model, slopes)

    def at(self, change: Float[Array, " m"]) -> Model:
        """Return the model after a small change of the parameters."""
        leaves, tree = jax.tree.flatten(self.model)
        moved = [
            leaf if slope is None else leaf + jnp.tensordot(change, slope, 1)
            for leaf, slope in zip(leaves, self.slopes)
        ]
        return jax.tree.unflatten(tree, moved)
