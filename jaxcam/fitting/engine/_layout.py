"""A model as a function of the values of its parameters."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
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
        flat = [jnp.ravel(leaves[k]) for k in moving]
        slopes = [row.reshape(len(values), one.size) for row, one in zip(rows, flat)]
        if not moving:
            flat, slopes = [jnp.zeros(0)], [jnp.zeros((len(values), 0))]
        return Expansion(
            origin,
            jnp.concatenate(flat),
            jnp.concatenate(slopes, axis=1),
            tuple(moving),
        )


class Expansion(eqx.Module):
    """A first-order expansion of a model in its parameters.

    The quantities needed at every step are computed and differentiated once, instead of
    in each piece.

    - `moving`: the indices of the leaves that depend on parameters; `flat` `(n,)`: the
        numbers in these leaves, one after another; `slopes` `(m, n)`: their
        derivatives.
    """

    model: Model
    flat: Float[Array, " n"]
    slopes: Float[Array, "m n"]
    moving: tuple[int, ...] = eqx.field(static=True)

    def by(self, columns: Int[Array, " m"], scales: Float[Array, " m"]) -> "Expansion":
        """Return the expansion in some of the parameters, in units of their scales."""
        slopes = self.slopes[columns] * scales[:, None]
        return Expansion(self.model, self.flat, slopes, self.moving)

    def at(self, change: Float[Array, " m"]) -> Model:
        """Return the model after a small change of the parameters."""
        leaves, tree = jax.tree.flatten(self.model)
        ends = np.cumsum([leaves[k].size for k in self.moving])
        # all numbers at once, because operations on each leaf compile slowly
        parts = jnp.split(self.flat + change @ self.slopes, ends[:-1])
        for k, part in zip(self.moving, parts):
            leaves[k] = part.reshape(leaves[k].shape)
        return jax.tree.unflatten(tree, leaves)
