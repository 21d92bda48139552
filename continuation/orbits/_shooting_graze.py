"""Compute multipliers of an orbit with impacts, one of which may have zero speed."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid.programs import program
from variational.orbits import (
    links_of,
    multipliers_at_grazing,
    product_of_links,
)

from .._eigenvalues import eigenvalues_of
from .._padding import as_compiled
from ._watched import Watched


# speed below which an impact counts as grazing, relative to one plus the largest
# component of the state: at located grazing points, the speed is lower, and a matrix
# divided by such a speed contains only rounding errors
_NO_SPEED = 1e-8
ONE = (
    "an impact has zero speed here: one multiplier is infinite, which is the limit "
    "for orbits with this impact"
)
NONE = (
    "the multipliers have no limit here: {}; see those of the neighbouring points on "
    "either side"
)


def multipliers_of(
    problem: Any, u: np.ndarray, parameters: Any, at: Any
) -> tuple[Any, str]:
    """Return the multipliers (k,), largest modulus first, and a sentence if any of them
    is infinite or unknown.
    """
    m = len(problem.constraints)
    speeds = np.array([float(at.monitors[Watched("speed", k).name]) for k in range(m)])
    least = _NO_SPEED * (1.0 + float(np.max(np.abs(u))))
    slow = np.flatnonzero(np.abs(speeds) <= least)
    if not slow.size:
        return eigenvalues_of(at.linearisation), ""
    unknown = np.full(at.linearisation.shape[0], np.nan, complex)
    if slow.size > 1:
        return unknown, NONE.format(f"{slow.size} impacts have zero speed")
    wide, v = as_compiled(problem, u)
    regular, singular = _parts(
        wide.equations, jnp.asarray(v), parameters, jnp.asarray(int(slow[0]))
    )
    found = multipliers_at_grazing(np.asarray(regular), np.asarray(singular))
    if not np.all(np.isfinite(found[1:])):
        return unknown, NONE.format("the grazing is not simple")
    if not problem.periods:
        # without forcing, remove the trivial multiplier one, which belongs to a shift
        # in time
        finite = np.flatnonzero(np.isfinite(found))
        trivial = finite[np.argmin(np.abs(found[finite] - 1.0))]
        found = np.delete(found, trivial)
    return found, ONE


@program
def _parts(equations, u, parameters, number):
    return product_of_links(equations, links_of(equations, u, parameters), number)
