"""Estimate bends of a cam: significant dents that low harmonics cannot describe.

A bend is a function of the cam angle with a Gaussian process prior (Matern kernel of
order 5/2), so it is zero where there are no data. Flights as low as the noise resemble
a bend, but their position changes with the cam speed. A bend is therefore accepted only
if it improves the prediction of one recording from the others.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


# The highest harmonic of a bend: it represents 98 % of a dent over a tenth of a radian
_HIGHEST = 32
# number of coefficients of a bend
WAVES = 2 * _HIGHEST + 1
# Correlation lengths (rad) and sizes (in units of the noise) to try
_LENGTHS = (0.1, 0.2, 0.4)
_SIZES = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
# Required gain of a bend in twice the log-likelihood: the penalty for the two
# parameters of a straight line, given the number of samples in typical recordings, plus
# an allowance for the unknown position of the bend
_SURE = 30.0


def waves(turned: Float[Array, "*k"]) -> Float[Array, "*k waves"]:
    """Return the contribution of each coefficient of a bend to the contact angle."""
    orders = jnp.arange(_HIGHEST + 1, dtype=float)
    phases = jnp.multiply.outer(turned, orders)
    return jnp.concatenate([jnp.cos(phases), jnp.sin(phases[..., 1:])], axis=-1)


def spread(length: float) -> Float[np.ndarray, " waves"]:
    """Return the standard deviation of each coefficient of a bend with unit
    variance.
    """
    orders = np.arange(_HIGHEST + 1)
    density = (1 + (orders * length) ** 2 / 5) ** -3.0
    density[1:] *= 2
    density = density / np.sum(density)
    return np.sqrt(np.concatenate([density, density[1:]]))


class Seen(NamedTuple):
    """Linearised information of one recording on the coefficients of a surface.

    The normal equations have the matrix `normal`, shape `(p, p)`, and the right-hand
    side `target`, shape `(p,)`; the coefficients of a bend come last.
    """

    normal: Float[np.ndarray, "p p"]
    target: Float[np.ndarray, " p"]


def bend_sizes(
    records: list[Seen],
    known: Float[np.ndarray, " q"],
    pull: Float[np.ndarray, " q"],
    noise: float,
) -> Float[np.ndarray, " waves"]:
    """Return the prior standard deviations of the coefficients of a bend; zero if no
    bend is significant.

    **Arguments:** `records` is the information from each recording; `known` and `pull`
    are the contributions of the tolerances of the `q` coefficients outside the bend to
    the diagonal of the normal matrix and to the right-hand side; `noise` is the
    standard deviation of a sample.
    """
    none = np.zeros(WAVES)
    if len(records) < 2:
        return none
    normal, target = _total(records)
    best, most = none, _SURE
    for length in _LENGTHS:
        for size in _SIZES:
            sizes = size * noise * spread(length)
            found = _evidence(normal, target, known, pull, sizes)
            if found > most:
                best, most = sizes, found
    if not np.any(best) or _foretold(records, known, pull, best) < _SURE:
        return none
    return best


def _evidence(normal, target, known, pull, sizes) -> float:
    """Return twice the log marginal likelihood, relative to that without a bend."""
    count = len(known)
    low = normal[:count, :count] + np.diag(known)
    across = normal[:count, count:]
    solved = np.linalg.solve(low, np.column_stack([across, target[:count] + pull]))
    inside = normal[count:, count:] - across.T @ solved[:, :-1]
    along = sizes * (target[count:] - across.T @ solved[:, -1])
    matrix = _scaled(inside, sizes)
    _, price = np.linalg.slogdet(matrix)
    return float(along @ np.linalg.solve(matrix, along) - price)


def _foretold(records, known, pull, sizes) -> float:
    """Return the total gain in twice the log-likelihood if each recording is predicted
    with the bend fitted to all others.

    The coefficients outside the bend are those fitted to all recordings.
    """
    count = len(known)
    normal, target = _total(records)
    units = np.append(1 / np.sqrt(known), sizes)
    right = units * np.append(target[:count] + pull, target[count:])
    low = (units * np.linalg.solve(_scaled(normal, units), right))[:count]
    total = 0.0
    for one in records:
        others = [other for other in records if other is not one]
        normal, target = _total(others)
        left = target[count:] - normal[count:, :count] @ low
        matrix = _scaled(normal[count:, count:], sizes)
        bend = sizes * np.linalg.solve(matrix, sizes * left)
        here = one.target[count:] - one.normal[count:, :count] @ low
        total += float(2 * bend @ here - bend @ one.normal[count:, count:] @ bend)
    return total


def _total(records: list[Seen]) -> tuple[np.ndarray, np.ndarray]:
    normal = np.sum([one.normal for one in records], axis=0)
    return normal, np.sum([one.target for one in records], axis=0)


def _scaled(normal, units) -> np.ndarray:
    """Return the normal matrix, including the prior, in units of the prior."""
    return np.eye(len(units)) + normal * np.outer(units, units)
