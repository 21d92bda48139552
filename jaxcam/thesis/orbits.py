"""Compute the P(1,1) branch of a rig from its fold to its flip and beyond."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from variational import impact_orbit, orbit_where
from variational.orbits import (
    ImpactOrbit,
    one_impact_orbits,
    orbit_monodromy,
    SpecialPoint,
)

from ..hybrid.programs import program
from ..models import CamFollower, rpm_to_rad_s
from .progress import counted
from .speeds import at_rpm, speed_of


NEAR_CAM = (0.3, 0.0)
"""A state near the cam from which Newton's method finds contact."""
SEARCH, _STRIDE = 148.0, 0.5
"""Speed at which the search for the branch starts, and largest step along it (rpm)."""


def first_orbit(system: CamFollower) -> ImpactOrbit | None:
    """Return the P(1,1) orbit at 148 rpm that is not a saddle, or None."""
    orbits = one_impact_orbits(at_rpm(system, SEARCH), jnp.array(NEAR_CAM))
    return orbits[0] if orbits else None


def orbit_at(system: CamFollower, start: ImpactOrbit, rpm: float) -> ImpactOrbit:
    """Follow the orbit `start` from 148 rpm to another speed."""
    strides = max(1, int(np.ceil(abs(rpm - SEARCH) / _STRIDE)))
    orbit = start
    speeds = np.linspace(SEARCH, rpm, strides + 1)[1:]
    for speed in counted(f"following an orbit to {rpm:.6g} rpm, step", speeds):
        orbit = next_orbit(at_rpm(system, speed), orbit)
    return orbit


def multipliers_at(system: CamFollower, start: ImpactOrbit, rpm: float) -> np.ndarray:
    """Return the two multipliers of P(1,1); NaN if it does not exist."""
    orbit = orbit_at(system, start, rpm)
    return ordered_multipliers(compiled_monodromy(at_rpm(system, rpm), orbit))


def ordered_multipliers(matrix) -> np.ndarray:
    """Return the eigenvalues, ordered by magnitude; a complex pair is ordered by its
    imaginary parts.
    """
    matrix = np.asarray(matrix)
    if not np.all(np.isfinite(matrix)):
        return np.full(2, np.nan, dtype=complex)
    values = np.linalg.eigvals(matrix).astype(complex)
    if np.any(np.imag(values) != 0):
        return values[np.argsort(np.imag(values))]
    return values[np.argsort(np.abs(values))]


# Lines (a, b) in the plane of the sum (trace) and the product of the multipliers: trace
# = a + b product. a = b = 1 is a fold, a = b = -1 is a flip, and b = 0 specifies a
# trace.
FOLD, FLIP = (1.0, 1.0), (-1.0, -1.0)


def point_on_line(
    system: CamFollower, guess: SpecialPoint, line: tuple[float, float]
) -> SpecialPoint:
    """Return the point of the branch on a line (a, b) as defined above;
    `guess.parameter` is in rad/s.
    """
    system = eqx.tree_at(speed_of, system, guess.parameter)
    return _point(system, guess.orbit, jnp.asarray(line[0]), jnp.asarray(line[1]))


def along_traces(
    system: CamFollower, start: ImpactOrbit, trace: float, stride: float = 0.1
) -> SpecialPoint:
    """Return the point with the sum of multipliers `trace`, reached from 148 rpm.

    The trace is monotonic along the branch even around the fold, where the speed is
    not.
    """
    point = SpecialPoint(jnp.asarray(rpm_to_rad_s(SEARCH)), start)
    moved = at_rpm(system, SEARCH)
    first = float(np.trace(np.asarray(compiled_monodromy(moved, start))))
    strides = max(1, int(np.ceil(abs(trace - first) / stride)))
    traces = np.linspace(first, trace, strides + 1)[1:]
    for value in counted("following an orbit by its multipliers, step", traces):
        point = point_on_line(system, point, (float(value), 0.0))
    return point


@program
def next_orbit(system, guess):
    return impact_orbit(system, guess)


@program
def compiled_monodromy(system, orbit):
    return orbit_monodromy(system, orbit)


@program
def _point(system, orbit, offset, slope):
    def test(matrix):
        return jnp.trace(matrix) - offset - slope * jnp.linalg.det(matrix)

    return orbit_where(system, speed_of, orbit, test)
