"""Cubic splines that represent free functions and parametric forms."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._parametric_form import MOST_PARTS, Place, Primitive
from ._primitives import MOST_NUMBERS, PRIMITIVES


# Number of knots of the spline that represents a function
_KNOTS = 332
# The spline continues beyond either end by this fraction of the range
BEYOND = 0.15


def _shares(knots, reach):
    """Return weights `(n, n)` that average values at knots over an integration step.

    **Arguments:** the knots, and the distance at which the weights vanish; zero for no
    averaging.
    """
    reach = jax.lax.stop_gradient(reach)
    apart = jnp.abs(knots[:, None] - knots[None])
    near = 1 - apart / jnp.where(reach > 0, reach, 1.0)
    shares = jnp.where(apart < reach, near, jnp.eye(_KNOTS))
    return shares / jnp.sum(shares, axis=1, keepdims=True)


def knots_of(low, high):
    """Return the start of the spline and the spacing of its knots."""
    width = high - low
    return low - BEYOND * width, width * (1 + 2 * BEYOND) / (_KNOTS - 3)


# compiled separately, so that it is traced once for all functions of a program
@jax.jit
def splines(numbers, forms, waves, ends, jumping, stride):
    """Return the coefficients of the spline, those for its derivatives if they differ
    (otherwise `None`), and the jump.
    """
    (rates, shifts), (low, high) = waves, ends
    first, spacing = knots_of(low, high)
    knots = first + spacing * (jnp.arange(_KNOTS, dtype=float) - 1.0)
    place = Place.between(knots, low, high)

    def both(table, apart=None):
        if stride is None:
            return table, None
        if apart is None:
            return table, table
        reach = jnp.minimum(stride, apart * (high - low))
        return table, _shares(knots, reach) @ table

    def nothing(own):
        return both(jnp.zeros(_KNOTS)), jnp.zeros(())

    def sines(own):
        each = jnp.stack(numbers[:-1]) * 3 / (2 + jnp.cos(rates * spacing))
        phases = jnp.outer(knots, rates) + shifts[None]
        return both(jnp.sin(phases) @ each), jumping * numbers[-1]

    def of(one: Primitive):
        def form(own):
            apart = None if one.apart is None else one.apart(own)
            return both(one.function(place, own), apart), one.jump * own[0]

        return form

    options = [nothing, sines, *map(of, PRIMITIVES)]

    def add(total, part):
        which, own = part
        return jax.tree.map(jnp.add, total, jax.lax.switch(which, options, own)), None

    # without any form, the function is a sum of sines
    alone = (jnp.arange(MOST_PARTS) == 0).astype(int)
    which = jnp.where(forms > 0, forms.astype(int) + 1, alone)
    # in a loop, each form is compiled once instead of once per part
    total, _ = jax.lax.scan(add, nothing(None), (which, _divided(numbers, forms)))
    return total


def _divided(numbers, forms) -> Float[Array, "m p"]:
    """Return the parameters of each form, which follow one another in `numbers`."""
    counts = jnp.array([0, *(one.count for one in PRIMITIVES)])[forms.astype(int)]
    first = jnp.cumsum(counts) - counts
    every = jnp.pad(jnp.stack(numbers), (0, MOST_NUMBERS))
    return every[first[:, None] + jnp.arange(MOST_NUMBERS)[None]]


@jax.jit
def interpolated(tables, place):
    """Return the values of splines at positions in units of their knots."""
    if place.ndim:
        return jax.vmap(interpolated, in_axes=(None, 0))(tables, place)
    first = jnp.clip(jnp.floor(place), 0, _KNOTS - 4)
    u = place - first
    weights = (
        (1 - u) ** 3 / 6,
        (3 * u**3 - 6 * u**2 + 4) / 6,
        (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6,
        u**3 / 6,
    )
    # one slice of all tables compiles faster than a look-up for each of their numbers
    given, tree = jax.tree.flatten(tables)
    near = jax.lax.dynamic_slice_in_dim(jnp.stack(given), first.astype(int), 4, axis=1)
    start, *more = (w * near[:, k] for k, w in enumerate(weights))
    found = sum(more, start)
    return jax.tree.unflatten(tree, [found[k] for k in range(len(given))])
