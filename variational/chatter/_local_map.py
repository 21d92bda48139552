"""The map of section 5.4: lobes around the interruption, measured, fitted, iterated."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam import HybridSystem
from jaxcam.parameters import as_arrays

from ._scalar import check_chatter_system
from ._section_turn import section_turn


# states that are followed together
_ROW = 32
# most rows that narrow a bracket: it ends at two neighbouring numbers before
_PASSES = 12


class Lobes(eqx.Module):
    """Lobes of the stroboscopic map, found by the number of impacts in a period."""

    corners: np.ndarray
    """Ends of the lobes, where the motion grazes, farthest first, shape `(k + 1,)`."""
    values: np.ndarray
    """The map at the corners, shape `(k + 1,)`."""
    points: np.ndarray
    """Points of each lobe, from its outer corner inwards, shape `(k, samples)`."""
    images: np.ndarray
    """The map at these points, shape `(k, samples)`."""
    slopes: np.ndarray
    """Slope of the map at these points, shape `(k, samples)`."""
    accumulation: float
    """Point at which the lobes accumulate."""
    limit: float
    """The map at the accumulation."""
    scan: np.ndarray
    """Points of the whole measured map, shape `(n,)`."""
    scanned: np.ndarray
    """The map at these points, shape `(n,)`."""
    impacts: np.ndarray
    """Number of impacts at these points, shape `(n,)`."""


class LocalMap(eqx.Module):
    """The fitted map (thesis, eqs. 5.2-5.5): one lobe, repeated with two scales."""

    Q: Float[Array, ""]
    """Logarithm of the scale of the image (thesis, eq. 5.2)."""
    M: Float[Array, ""]
    """Logarithm of the scale of the point (thesis, eq. 5.2)."""
    delta_pi: Float[Array, ""]
    """Height of the first lobe."""
    delta_x: Float[Array, ""]
    """Width of the first lobe; x_1 = x_0 - width."""
    coefficients: Float[Array, " n"]
    """Coefficients c_0..c_n of thesis eq. 5.3, in powers of x - x_0."""
    root: Float[Array, ""]
    """Coefficient d of the root in thesis eq. 5.3."""
    x_0: Float[Array, ""]
    """Right end of the first lobe."""
    p_0: Float[Array, ""]
    """The map at `x_0`."""

    @property
    def x_inf(self) -> Float[Array, ""]:
        """Point at which the lobes accumulate (thesis, eq. 5.5)."""
        return self.x_0 - self.delta_x / (1 - jnp.exp(self.M))

    @property
    def alpha_inf(self) -> Float[Array, ""]:
        """The map at the accumulation and beyond it (thesis, eq. 5.5)."""
        return self.p_0 + self.delta_pi / (1 - jnp.exp(self.Q))

    def lobe(self, x) -> Float[Array, "..."]:
        """Return p(x) of the first lobe (thesis, eq. 5.3).

        Args:
            x: Points, any shape.

        Returns:
            The map, in the shape of `x`.
        """
        y = x - self.x_0
        smooth = jnp.polyval(self.coefficients[::-1], y)
        inside = jnp.maximum(y / -self.delta_x, 0.0)
        return smooth + self.root * jnp.sqrt(jnp.abs(self.delta_x) * inside)

    def __call__(self, x) -> Float[Array, "..."]:
        """The map: constant beyond the accumulation, else lobe j of thesis eq. 5.4.

        NaN outside the first lobe, of which the fit knows nothing.
        """
        width = 1 - jnp.exp(self.M)
        # sum of beta_k up to j - 1, solved for j
        share = (self.x_0 - x) / self.delta_x * width
        lobes = share < 1
        depth = jnp.log(jnp.where(lobes, 1 - share, 1.0)) / self.M
        j = jnp.maximum(jnp.floor(depth * (1 + 1e-14)), 0.0)
        gamma, beta = jnp.exp(j * self.Q), jnp.exp(j * self.M)
        x_j = self.x_0 - self.delta_x * (1 - beta) / width
        alpha = self.delta_pi * (1 - gamma) / (1 - jnp.exp(self.Q))
        alpha = alpha + self.p_0 * (1 - gamma)
        inside = gamma * self.lobe(self.x_0 + (x - x_j) / beta) + alpha
        known = jnp.where(share >= 0, inside, jnp.nan)
        return jnp.where(share >= 1, self.alpha_inf, known)


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
    """Measure the stroboscopic map around the interruption and find its lobes.

    A lobe ends where the number of impacts changes, to rounding (thesis, eq. 5.1).

    Args:
        system: As for [`variational.chatter_frame`][], near the interruption.
        state: State at time `phase` x period on the sticking orbit, shape `(2,)`.
        deviations: Deviations of `component`, `(n,)`, across the accumulation.
        phase: Phase of the section, in periods.
        component: Component of the state that deviates.
        direction: Direction along which the state deviates, shape `(2,)`; default
            `component` alone. A map to iterate needs `ComposedMap.vector`.
        samples: Number of points measured in each lobe.
        most: Largest number of lobes.
        progress: Called with the fraction done, of as many lobes as asked for.

    Returns:
        The [`variational.chatter.Lobes`][].

    Raises:
        ValueError: Fewer than two lobes are found.
    """
    check_chatter_system(system)
    system = as_arrays(system)
    state = jnp.asarray(state, jnp.float64)
    base = float(state[component])
    axis = jnp.zeros(2).at[component].set(1.0)
    along = axis if direction is None else jnp.asarray(direction, jnp.float64)
    if float(along[component]) == 0:
        raise ValueError(
            f"direction is {np.asarray(along)}: it does not change component "
            f"{component}. Give another component or direction."
        )
    along = along / along[component]
    scan = base + np.asarray(deviations, dtype=float)
    done = 0
    # of the scan, the brackets, the points of the lobes, and three single ones
    total = _rows(len(scan)) + (most + 2) * _PASSES + _rows(most * samples) + 3

    def turn(x):
        # in rows of one length, so that one compiled program serves all
        nonlocal done
        rows = _rows(len(x))
        padded = np.concatenate([x, np.full(rows * _ROW - len(x), x[-1])])
        parts = []
        for row in padded.reshape(rows, _ROW):
            row = jnp.asarray(row)
            parts.append(_turns(system, state, along, row, phase, component))
            done += 1
            if progress is not None:
                progress(done / total)
        return tuple(
            np.concatenate([np.asarray(v) for v in column])[: len(x)]
            for column in zip(*parts, strict=True)
        )

    scanned, _, impacts, stuck = turn(scan)
    if np.all(stuck) or not np.any(stuck):
        raise ValueError(
            "The deviations stay on one side of the interruption: chattering is "
            "complete for all of them or for none. Take a wider range of both signs."
        )
    # outwards from the last period that sticks
    edge = np.flatnonzero(np.diff(stuck.astype(int)))[0]
    inner, outer = (edge, edge + 1) if stuck[edge] else (edge + 1, edge)
    bottom, top = _bisect(turn, float(scan[inner]), float(scan[outer]), lambda n, s: s)
    accumulation = 0.5 * (bottom + top)
    limit = turn(np.array([bottom]))[0][0]

    farthest = scan[-1] if stuck[edge] else scan[0]
    corners = _corners(turn, accumulation, farthest, most)
    # dense at the outer corner, where the slope is infinite
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


def _rows(states: int) -> int:
    return -(-states // _ROW)


def _corners(turn, accumulation, farthest, most: int) -> np.ndarray:
    """Return where the number of impacts of the period changes, farthest first."""
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
            "interrupted chattering."
        )
    return corners


@eqx.filter_jit
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
    """The two neighbouring numbers between which `is_near(impacts, stuck)` changes.

    A row of points at once: each pass narrows the bracket 33-fold.
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


def fit_local_map(lobes: Lobes) -> LocalMap:
    """Fit thesis eqs. 5.2-5.5: scales by lines through logarithms, one lobe by eq. 5.3.

    The cubic with a root passes through both ends of the first lobe and has the
    measured slope where that is 1, 0 and -1; a slope that the lobe does not have is
    replaced by its nearest.

    Args:
        lobes: The measured lobes.

    Returns:
        A [`variational.chatter.LocalMap`][].
    """
    width, height = np.abs(np.diff(lobes.corners)), np.abs(np.diff(lobes.values))
    k = np.arange(len(width))
    M = np.polyfit(k, np.log(width), 1)[0]
    Q = np.polyfit(k, np.log(height), 1)[0]
    x_0, p_0 = lobes.corners[0], lobes.values[0]
    delta_x, delta_pi = x_0 - lobes.corners[1], lobes.values[1] - p_0
    picks = [_where_slope(lobes.points[0], lobes.slopes[0], v) for v in (1, 0, -1)]
    size, sign = abs(delta_x), np.sign(delta_x)
    rows, right = [], []
    for y, value in ((0.0, p_0), (-delta_x, lobes.values[1])):
        rows.append([1.0, y, y**2, y**3, np.sqrt(abs(y))])
        right.append(value)
    for point, slope in picks:
        y = point - x_0
        rows.append([0.0, 1.0, 2 * y, 3 * y**2, -sign / (2 * np.sqrt(abs(y)))])
        right.append(slope)
    scale = np.array([1.0, size, size**2, size**3, np.sqrt(size)])
    rows = np.array(rows) / scale
    rows[2:] *= size
    right = np.array(right)
    right[2:] *= size
    found = np.linalg.lstsq(rows, right, rcond=None)[0] / scale
    values = (Q, M, delta_pi, delta_x, found[:4], found[4], x_0, p_0)
    return LocalMap(*(jnp.asarray(v, dtype=jnp.float64) for v in values))


def _where_slope(points, slopes, wanted):
    """A point of the lobe with this slope, or with the nearest to it."""
    finite = np.isfinite(slopes) & (np.arange(len(slopes)) > 0)
    points, slopes = points[finite], slopes[finite]
    change = np.flatnonzero((slopes[:-1] - wanted) * (slopes[1:] - wanted) <= 0)
    if len(change) == 0:
        k = int(np.argmin(np.abs(slopes - wanted)))
        return points[k], slopes[k]
    k = change[0]
    share = (wanted - slopes[k]) / (slopes[k + 1] - slopes[k])
    return points[k] + share * (points[k + 1] - points[k]), wanted


def iterate_local_map(
    local: LocalMap, shifts, turns: int = 400, keep: int = 100
) -> Float[Array, "shifts keep"]:
    """Iterate the fitted map, shifted by each of `shifts` (thesis, Figure 5.28).

    Args:
        local: The fitted map.
        shifts: Shifts in the units of x, shape `(k,)`; the map of x is that of x +
            shift.
        turns: Number of iterations.
        keep: Number of last iterates to keep.

    Returns:
        Iterates, shape `(k, keep)`.

    Examples:
        >>> from variational import iterate_local_map
        >>> from variational.chatter import LocalMap
        >>> numbers = (-1.0, -1.0, 1.0, 1.0, [0.0, 1.0], 0.5, 1.0, 0.0)
        >>> local = LocalMap(*map(jnp.asarray, numbers))
        >>> iterate_local_map(local, jnp.zeros(3), turns=20, keep=5).shape
        (3, 5)
    """
    return _iterate(local, jnp.asarray(shifts, jnp.float64), turns, keep)


@eqx.filter_jit
def _iterate(local, shifts, turns, keep):
    def one(shift):
        def step(x, _):
            x = local(x + shift)
            return x, x

        return jax.lax.scan(step, local.alpha_inf, length=turns)[1][turns - keep :]

    return jax.vmap(one)(shifts)
