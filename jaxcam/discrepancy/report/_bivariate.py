"""Free functions of two arguments: tables, words and derivatives."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..terms import Bivariate, BivariateForce, Family, unit_along
from ._curves import degree_of, determined, errors_of
from ._words import quantity


class BivariateTable(NamedTuple):
    """A function on a grid of both arguments, its standard error, and a description."""

    grid: tuple[Float[np.ndarray, " n"], Float[np.ndarray, " m"]]
    value: Float[np.ndarray, "n m"]
    stderr: Float[np.ndarray, "n m"]
    words: str


def bivariate_table(
    family: Bivariate,
    numbers: Float[np.ndarray, " p"],
    covariance: Float[np.ndarray, "p p"],
    points: int,
    unit: str,
) -> BivariateTable:
    """Return a function on a grid with a number of points of each argument.

    If rig parameters act like a constant or a straight line, the error is that of the
    remainder.

    **Arguments:** the family, the parameters and their covariance, the number of
    points, and the unit of the function.
    """
    grid, pairs = _grid(family, points)
    basis = family.basis(*pairs)
    value, stderr = basis @ numbers, errors_of(basis, covariance)
    by_rig = _by_rig(family, pairs)
    # where the function is known best counts most
    weights = 1 / np.maximum(stderr, np.finfo(float).tiny)
    fitted = np.linalg.pinv(weights[:, None] * by_rig) * weights
    rest = basis - by_rig @ (fitted @ basis)
    level, error = rest @ numbers, errors_of(rest, covariance)
    words = _words(family, pairs, level, error, unit)
    stderr = determined(stderr, error)
    shape = points, points
    return BivariateTable(grid, value.reshape(shape), stderr.reshape(shape), words)


def bivariate_slopes(
    term: BivariateForce, names: Sequence[str], points: int
) -> Float[np.ndarray, "k p"]:
    """Return the derivatives of a function with respect to some of its parameters, on a
    grid over both ranges with about the given number of points.
    """
    side, axes = math.isqrt(points), (term.first, term.second)
    grid = [jnp.linspace(one.low, one.high, side) for one in axes]
    along, across = (one.ravel() for one in jnp.meshgrid(*grid, indexing="ij"))
    every = jax.vmap(term.slopes)(along, across)
    return np.asarray(every)[:, [int(name.rpartition("_")[2]) for name in names]]


def _grid(family: Bivariate, points: int):
    """Return equidistant points of each argument, and all pairs of them."""
    along, across = (np.linspace(one.low, one.high, points) for one in family)
    grid = along, across
    pairs = [one.ravel() for one in np.meshgrid(*grid, indexing="ij")]
    return grid, pairs


def _by_rig(family: Bivariate, pairs) -> Float[np.ndarray, "n k"]:
    """Return the functions that rig parameters can represent: a constant, and straight
    lines of positions and velocities.
    """
    lines = [at for one, at in zip(family, pairs) if degree_of(one)]
    return np.column_stack([np.ones(len(pairs[0])), *lines])


def _words(family: Bivariate, pairs, level, error, unit: str) -> str:
    what = f"a force that depends on the {' and the '.join(family.arguments)}"
    sure = np.abs(level) > 2 * error
    if not np.any(sure):
        return f"{what}; its location is unclear"
    k = int(np.argmax(np.where(sure, np.abs(level), -1.0)))
    places = " and ".join(_place(one, at[k]) for one, at in zip(family, pairs))
    by = quantity(f"{level[k]:.2g} +- {error[k]:.1g}", unit)
    usual = "a straight line" if _by_rig(family, pairs).shape[1] > 1 else "a constant"
    return f"{what}; it differs most from {usual} at {places}, by {by}"


def _place(family: Family, at: float) -> str:
    unit = unit_along(family.argument, family.motion_unit)
    return f"{family.argument} {quantity(f'{at:.3g}', unit)}"
