"""Detect grazing bifurcations that accumulate where chatter becomes complete.

Each of these bifurcations adds one impact, and the distances between them decrease
geometrically. Their limit is the interruption of the chatter of an orbit that sticks;
it is computed independently.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxcam.parameters import as_arrays
from variational import chatter_interruption

from .._parameter import leaf_of, with_leaf


# number of successive grazing bifurcations needed to detect an accumulation
_LEAST = 5
# allowed change of the ratio of successive distances
_STEADY = 0.02
# allowed distance between the computed interruption and the limit extrapolated from the
# bifurcations, relative to the distance of the last bifurcation from this limit
_AGREES = 0.5

# distance from the interruption at which the continued branch starts, relative to the
# parameter
_INSIDE = 1e-13


class Accumulation(NamedTuple):
    """The interruption of chatter at which grazing bifurcations accumulate."""

    system: Any
    """The system at the interruption."""
    value: float
    """Value of the parameter at the interruption."""
    distance: float
    """Change of the parameter from the last bifurcation to the interruption."""


def accumulation(problem: Any, points: Sequence[Any]) -> Accumulation | None:
    """Return where grazing bifurcations accumulate, or None if they do not.

    `problem` is an `ImpactingOrbits`, and `points` are the bifurcations so far. The
    theory of chatter applies to systems with two states and one constraint.
    """
    last = points[-_LEAST:]
    planar = problem.dimension == 2 and set(problem.constraints) == {0}
    if len(last) < _LEAST or problem.periods == 0 or not planar:
        return None
    orbits = [problem.with_signature(point.signature) for point in last]
    if any(type(orbit) is not type(problem) for orbit in orbits):
        return None
    impacts = np.array([len(orbit.constraints) for orbit in orbits])
    values = np.array([point.parameter for point in last])
    distances = np.diff(values)
    if np.any(np.diff(impacts) != 1) or np.any(distances == 0):
        return None
    ratios = distances[1:] / distances[:-1]
    if not np.all((ratios > 0) & (ratios < 1)):
        return None
    if abs(ratios[-1] - ratios[-2]) > _STEADY:
        return None
    rest = float(distances[-1] * ratios[-1] / (1 - ratios[-1]))
    leaf = last[-1].leaf
    system = as_arrays(last[-1].solved.parameters)
    bracket = (float(values[-1]), float(values[-1]) + 2 * rest)
    try:
        found = chatter_interruption(
            system,
            lambda parameters: leaf_of(parameters, leaf),
            bracket,
            problem.periods,
        )
    except ValueError:
        return None
    value = float(found)
    # at the interruption itself, the sign of the margin is that of a rounding error
    value += _INSIDE * max(abs(value), abs(rest)) * float(np.sign(rest))
    if abs(value - values[-1] - rest) > _AGREES * abs(rest):
        return None
    moved = with_leaf(system, leaf, jnp.asarray(value))
    return Accumulation(moved, value, value - float(values[-1]))
