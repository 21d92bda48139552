"""Choose the prior of a free function by its marginal likelihood."""

import math
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ...fitting.engine import invert_information
from ..policy import Policy


class Roughness(NamedTuple):
    """The prior of a function with the largest marginal likelihood.

    - `gain`: twice the logarithm of the marginal likelihood, minus that without the
      function.
    - `length`: correlation length. `size`: standard deviation of the function.
    """

    gain: float = 0.0
    length: float = 1.0
    size: float = 1.0


@runtime_checkable
class Varied(Protocol):
    """A function, of one argument or several, with a prior of given length."""

    def prior_variances(self, count: int, length: float) -> Float[np.ndarray, " count"]:
        """Return the variances of the coefficients of a function of variance one."""
        ...


def roughness(
    information,
    score,
    free,
    own,
    family: Varied,
    value: Float[np.ndarray, " k"],
    policy: Policy,
) -> Roughness:
    """Return the prior of a function, from the quadratic likelihood about a point.

    With the `free` parameters eliminated, coefficients with a Gaussian prior have the
    marginal likelihood of Rasmussen and Williams, Gaussian Processes for Machine
    Learning 2006, eq. 2.30, here expressed by information and score.

    **Arguments:** information and score without the prior of the coefficients; rows of
    the free parameters, and of the coefficients of the function; the values of these
    coefficients at the point; the policy. The gain is relative to the likelihood at the
    point.
    """
    inside, pull = beside(information, score, free, own, policy.distinct_information)
    seen = float(np.trace(inside))
    if not seen > 0:
        return Roughness(-math.inf, max(policy.function_lengths), 1.0)
    unit = math.sqrt(len(own) / seen)
    best = Roughness(-math.inf, max(policy.function_lengths), unit)
    for length in policy.function_lengths:
        variances = family.prior_variances(len(own), length)
        sizes = unit * np.asarray(policy.function_sizes)
        gains = _gains(inside, pull, np.sqrt(variances), sizes, value)
        for size, found in zip(sizes, gains):
            if found > best.gain:
                best = Roughness(float(found), length, float(size))
    return best


def occam(
    information, free, own, spread: Float[np.ndarray, " k"], alike: float
) -> float:
    """Return the Occam factor of a function, `log det(1 + S A S)`, with the information
    A and the prior standard deviations S of its coefficients.
    """
    inside, _ = beside(information, np.zeros(len(information)), free, own, alike)
    return occam_of(inside, spread)


def occam_of(
    inside: Float[np.ndarray, "k k"], spread: Float[np.ndarray, " k"]
) -> float:
    """Return the Occam factor, given the information on the coefficients `inside`."""
    values = np.linalg.eigvalsh(inside * np.outer(spread, spread))
    return float(np.sum(np.log1p(np.maximum(values, 0.0))))


def beside(information, score, free, own, alike: float):
    """Return information and score of some rows, with the free parameters eliminated.

    If the free parameters represent a combination of these rows so well that less than
    a fraction `distinct_information` of the information on it remains, its information
    and score are zero, because only rounding errors would be left.
    """
    free = np.setdiff1d(free, own)
    free = free[np.diag(information)[free] > 0]
    inverse = invert_information(information[np.ix_(free, free)])
    across = information[np.ix_(own, free)]
    inside = information[np.ix_(own, own)] - across @ inverse @ across.T
    pull = score[own] - across @ (inverse @ score[free])
    # rounding may make the information slightly negative
    size = np.sqrt(np.maximum(np.diag(information)[own], 0.0))
    unit = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
    values, vectors = np.linalg.eigh(inside * np.outer(unit, unit))
    seen = values > alike
    kept = vectors[:, seen]
    inside = np.outer(size, size) * ((kept * values[seen]) @ kept.T)
    return inside, size * (kept @ (kept.T @ (unit * pull)))


def _gains(inside, pull, spread, sizes, value) -> Float[np.ndarray, " s"]:
    """Return the gains for prior standard deviations that are multiples of `spread`."""
    used = spread > 0
    spread, value = spread[used], value[used]
    inside, pull = inside[np.ix_(used, used)], pull[used]
    # one decomposition serves all sizes; rounding must not make information negative
    values, vectors = np.linalg.eigh(inside * np.outer(spread, spread))
    values = 1 + np.outer(sizes**2, np.maximum(values, 0.0))
    here = value / spread
    told, known = vectors.T @ (spread * pull), vectors.T @ here
    along = np.outer(sizes, told) - np.outer(1 / sizes, known)
    gains = np.sum(along**2 / values - np.log(values), axis=1)
    return gains - here @ here / sizes**2
