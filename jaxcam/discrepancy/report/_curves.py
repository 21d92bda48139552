"""Curves of unnamed functions: values, slopes and standard errors."""

from collections.abc import Sequence

import equinox as eqx
import jax
import numpy as np

from ...fitting import Fit
from ...fitting.engine import invert_information
from ...hybrid.programs import program
from ..policy import Policy
from ..search import blocks_of, Free, free_term
from ..terms import Family, FreeFunction, Variable


# Ratio of the errors with and without the part that rig parameters can represent above
# which that part is not determined
_UNDETERMINED = 3.0
# Points at which a function is evaluated, for each point of its table
_FINER = 20


def curve(one: Free, along, numbers):
    """Return the function without its factor, and its derivatives with respect to its
    parameters.
    """
    family = one.family
    direction = np.tanh(along / family.slip) if family.jumps else np.zeros(len(along))
    term = free_term(family, one.slot, one.primitive).exact()
    made = with_slopes(term, np.asarray(along), direction, np.asarray(numbers))
    return tuple(map(np.asarray, made))


@program
def with_slopes(term: FreeFunction, along, direction, numbers):
    """Return a function without its factor, and its derivatives with respect to its
    first coefficients.
    """

    def values(numbers):
        every = (*numbers, *term.coefficients[len(numbers) :])
        fresh = eqx.tree_at(lambda f: f.coefficients, term, every).prepared()
        return jax.vmap(fresh.at)(along, direction)

    return values(numbers), jax.jacfwd(values)(numbers)


def graded(even: np.ndarray, function) -> np.ndarray:
    """Return the given number of points, with a function almost linear between them.

    The points are equidistant along the graph of the function, with both axes scaled
    to their ranges, so that several points lie on a step.
    """
    points = len(even)
    fine = np.linspace(even[0], even[-1], _FINER * points)
    value = np.asarray(function(fine))
    size = np.ptp(value)
    if not np.all(np.isfinite(value)):
        return even
    rise = np.abs(np.diff(value)) / (size if size > 0 else 1.0)
    passed = np.append(0.0, np.cumsum(rise + 1 / len(fine)))
    return np.interp(np.linspace(0.0, passed[-1], points), passed, fine)


def errors_of(basis, covariance):
    """Return the standard errors of linear combinations (rows) of coefficients."""
    return np.sqrt(np.maximum(np.einsum("kp,pq,kq->k", basis, covariance, basis), 0.0))


def determined(error: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Return the standard errors of a function, or those of the rest of it if the part
    that rig parameters can represent is not determined.
    """
    large = np.median(error) > _UNDETERMINED * np.median(rest)
    return rest if large else error


def level_of(family: Family, along, values):
    """Return functions (columns) without the part that rig parameters can represent:
    a constant, and a straight line if the argument is a position or velocity.
    """
    return values - np.vander(along, degree_of(family) + 1) @ np.polyfit(
        along, values, degree_of(family)
    )


def degree_of(family: Family) -> int:
    return 0 if family.periodic or family.argument is Variable.TIME else 1


def covariance_of(found: Fit, names: Sequence[str], policy: Policy):
    """Return the covariance of some parameters.

    If the fit is poor, its own covariance may contain pieces whose derivatives diverge;
    these are left out here. The variance of a coefficient that only its prior
    determines is infinite in a fit, and that of the prior here.
    """
    if found.cost < policy.near_cost * found.problem.samples:
        labels = [estimate.name for estimate in found.estimates]
        rows = [labels.index(name) for name in names]
        covariance = found.covariance[np.ix_(rows, rows)]
        if np.all(np.isfinite(covariance)):
            return covariance
    blocks = blocks_of(found.problem, found.point, names=found.free)
    information, _ = blocks.total()
    every, own = blocks.rows(found.free), blocks.rows(names)
    inverse = invert_information(information[np.ix_(every, every)])
    at = np.searchsorted(every, own)
    unit = blocks.scale[own]
    return inverse[np.ix_(at, at)] * np.outer(unit, unit)
