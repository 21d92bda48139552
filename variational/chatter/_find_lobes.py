"""Sample the map around the interruption, and find its lobes from the number of
impacts.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxcam import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.parameters import as_arrays

from ._scalar import check_chatter_system
from ._section_turn import section_turn


# number of states that are followed together
_ROW = 32
# maximum number of rows used to narrow a bracket; the search ends earlier if the ends
# of the bracket are neighbouring floats
_PASSES = 12


class Lobes(eqx.Module):
    """Lobes of the stroboscopic map, identified by the number of impacts per period."""

    corners: np.ndarray
    """Ends of the lobes, where the motion grazes, farthest first, shape `(k + 1,)`."""
    values: np.ndarray
    """Values of the map at the corners, shape `(k + 1,)`."""
    points: np.ndarray
    """Points of each lobe, from its outer corner inwards, shape `(k, samples)`."""
    images: np.ndarray
    """Values of the map at `points`, shape `(k, samples)`."""
    slopes: np.ndarray
    """Slope of the map at `points`, shape `(k, samples)`."""
    accumulation: float
    """Point at which the lobes accumulate."""
    limit: float
    """Value of the map at the accumulation point."""
    scan: np.ndarray
    """Points of the sampled map, shape `(n,)`."""
    scanned: np.ndarray
    """Values of the map at the points of `scan`, shape `(n,)`."""
    impacts: np.ndarray
    """Number of impacts at the points of `scan`, shape `(n,)`."""


def find_lobes(
    system: HybridSystem,
    state,
    deviations,
    *,
    phase: float = 0.0,
    component: int = 0,
    direction=None,
    samples: int = 64,
    most: int = 8,
    progress: Callable[[float], None] | None = None,
) -> Lobes:
    """Sample the stroboscopic map around the interruption and find its lobes.

    A lobe is a part of the map on which the number of impacts per period is constant;
    its ends are located to within rounding error (thesis, eq. 5.1).

    Args:
        system: A system as for [`variational.chatter_frame`][], near the interruption.
        state: State at time `phase` x period on the sticking orbit, shape `(2,)`.
        deviations: Deviations of `component`, shape `(n,)`, on both sides of the
            accumulation.
        phase: Phase of the section, in periods.
        component: Component of the state that deviates.
        direction: Direction along which the state deviates, shape `(2,)`; default: only
            `component`. For a map that is to be iterated, pass `ComposedMap.vector`.
        samples: Number of points sampled in each lobe.
        most: Maximum number of lobes.
        progress: Called with the completed fraction, relative to `most` lobes.

    Returns:
        The [`variational.chatter.Lobes`][].

    Raises:
        ValueError: Fewer than two lobes are found, chatter is complete for all
            deviations or for none, `direction` does not change `component`, or the
            system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import find_lobes, scaling_law
        >>> system = ImpactOscillator(omega=0.6071945, restitution=0.5)
        >>> state = jnp.array([-0.1041427, -0.2869127])  # on the sticking orbit
        >>> sides = np.linspace(-1e-3, 1e-3, 32)
        >>> lobes = find_lobes(system, state, sides, phase=0.35, samples=16, most=3)
        >>> widths = np.abs(np.diff(lobes.corners))
        >>> (widths[1:] / widths[:-1]).round(3).tolist()
        [0.502, 0.502]
        >>> round(float(scaling_law(0.5).q), 3)  # the limit of these ratios
        0.503
    """
    check_chatter_system(system)
    system = as_arrays(system)
    state = jnp.asarray(state, jnp.float64)
    base = float(state[component])
    along = _along(direction, component)
    scan = base + np.asarray(deviations, dtype=float)
    # number of rows for the scan, the brackets, the points of the lobes, and three
    # calls with one row each
    total = _rows(len(scan)) + (most + 2) * _PASSES + _rows(most * samples) + 3
    turn = _Rows(
        lambda row: _turns(system, state, along, row, phase, component), total, progress
    )
    scanned, _, impacts, stuck = turn(scan)
    if np.all(stuck) or not np.any(stuck):
        raise ValueError(
            "The deviations stay on one side of the interruption: chatter is complete "
            "for all of them or for none. Use a wider range with both signs."
        )
    # the accumulation lies between the last motion that sticks and its neighbour
    edge = np.flatnonzero(np.diff(stuck.astype(int)))[0]
    inner, outer = (edge, edge + 1) if stuck[edge] else (edge + 1, edge)
    bottom, top = _bisect(turn, float(scan[inner]), float(scan[outer]), lambda n, s: s)
    accumulation = 0.5 * (bottom + top)
    limit = turn(np.array([bottom]))[0][0]

    farthest = scan[-1] if stuck[edge] else scan[0]
    corners = _corners(turn, accumulation, farthest, most)
    # points are dense at the outer corner, where the slope is infinite
    share = np.linspace(0.0, 1.0, samples) ** 2
    points = corners[:-1, None] + share * np.diff(corners)[:, None]
    images, slopes, _, _ = turn(points.ravel())
    values = turn(corners)[0]
    if progress is not None:
        progress(1.0)
    return Lobes(
        corners=corners,
        values=values,
        points=points,
        images=images.reshape(points.shape),
        slopes=slopes.reshape(points.shape),
        accumulation=float(accumulation),
        limit=float(limit),
        scan=scan,
        scanned=scanned,
        impacts=impacts,
    )


def _along(direction, component: int):
    """Return the direction, scaled so that `component` changes by one."""
    axis = jnp.zeros(2).at[component].set(1.0)
    along = axis if direction is None else jnp.asarray(direction, jnp.float64)
    if float(along[component]) == 0:
        raise ValueError(
            f"direction is {np.asarray(along)}: it does not change component "
            f"{component}. Give another component or direction."
        )
    return along / along[component]


def _rows(states: int) -> int:
    return -(-states // _ROW)


class _Rows:
    """Evaluates the map for many states in rows of equal length, with one program."""

    def __init__(self, program: Callable, total: int, progress: Callable | None):
        self._program, self._total, self._progress = program, total, progress
        self._done = 0

    def __call__(self, x) -> tuple[np.ndarray, ...]:
        rows = _rows(len(x))
        padded = np.concatenate([x, np.full(rows * _ROW - len(x), x[-1])])
        parts = []
        for row in padded.reshape(rows, _ROW):
            parts.append(self._program(jnp.asarray(row)))
            self._done += 1
            if self._progress is not None:
                self._progress(self._done / self._total)
        return tuple(
            np.concatenate([np.asarray(v) for v in column])[: len(x)]
            for column in zip(*parts, strict=True)
        )


def _corners(turn, accumulation, farthest, most: int) -> np.ndarray:
    """Return the points at which the number of impacts per period changes, farthest
    first.
    """
    number = turn(np.array([farthest]))[2][0]
    corners = []
    for k in range(1, most + 2):
        near, _ = _bisect(
            turn, accumulation, farthest, lambda n, s, m=number + k: s | (n >= m)
        )
        corners.append(near)
    corners = np.array(corners)
    wide = np.abs(np.diff(corners)) > 1e-9 * np.abs(corners[0] - accumulation)
    corners = corners[: 1 + np.argmin(np.append(wide, False))]
    if len(corners) < 3:
        raise ValueError(
            "Fewer than two lobes were found; widen the deviations on the side of "
            "interrupted chatter."
        )
    return corners


@program
def _turns(system, state, along, values, phase, component):
    def image(x):
        moved = state + (x - state[component]) * along
        section = section_turn(system, moved.at[component].set(x), phase)
        return section.state[component], (section.impacts, section.stuck)

    def one(x):
        end, slope, (impacts, stuck) = jax.jvp(
            image, (x,), (jnp.ones_like(x),), has_aux=True
        )
        return end, slope, impacts, stuck

    return jax.vmap(one)(values)


def _bisect(turn: Callable, near: float, far: float, is_near: Callable):
    """Find the two neighbouring floats between which `is_near(impacts, stuck)` changes.

    Each pass evaluates a row of points and narrows the bracket 33-fold.
    """
    for _ in range(_PASSES):
        row = np.linspace(near, far, _ROW + 2)
        _, _, impacts, stuck = turn(row[1:-1])
        yes = np.concatenate([[True], is_near(impacts, stuck), [False]])
        last = int(np.argmin(yes)) - 1
        near, far = row[last], row[last + 1]
        if abs(far - near) <= 4e-16 * abs(near):
            break
    return near, far
