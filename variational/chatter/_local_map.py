"""Fit and iterate the map with lobes around the interruption (thesis, section 5.4)."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid.programs import program

from ._find_lobes import Lobes


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
    """Coefficients c_0..c_n in powers of x - x_0 (thesis, eq. 5.3)."""
    root: Float[Array, ""]
    """Coefficient d of the root (thesis, eq. 5.3)."""
    x_0: Float[Array, ""]
    """Right end of the first lobe."""
    p_0: Float[Array, ""]
    """Value of the map at `x_0`."""

    @property
    def x_inf(self) -> Float[Array, ""]:
        """Point at which the lobes accumulate (thesis, eq. 5.5)."""
        return self.x_0 - self.delta_x / (1 - jnp.exp(self.M))

    @property
    def alpha_inf(self) -> Float[Array, ""]:
        """Value of the map at and beyond the accumulation point (thesis, eq. 5.5)."""
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
        """Evaluate the map: constant beyond the accumulation, otherwise the lobe that
        contains `x` (thesis, eq. 5.4).

        The result is NaN beyond `x_0`, the outer end of the first lobe, where the fit
        is not valid.
        """
        width = 1 - jnp.exp(self.M)
        # the number j of complete lobes between x_0 and x, from the sum of their widths
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


def fit_local_map(lobes: Lobes) -> LocalMap:
    """Fit the local map of the thesis, eqs. 5.2-5.5, to sampled lobes.

    The scales follow from straight lines through the logarithms of the widths and
    heights of the lobes, and the shape from the first lobe. The cubic with a square
    root (thesis, eq. 5.3) passes through both ends of the first lobe and matches the
    sampled slope at its points of slope 1, 0 and -1; a slope that the lobe does not
    reach is replaced by the nearest one.

    The example continues the one in [`variational.find_lobes`][].

    Args:
        lobes: The sampled lobes.

    Returns:
        A [`variational.chatter.LocalMap`][].

    Examples:
        >>> from variational import fit_local_map
        >>> local = fit_local_map(lobes)
        >>> round(float(jnp.exp(local.M)), 3), round(float(jnp.exp(local.Q)), 3)
        (0.502, 0.437)
        >>> law = scaling_law(0.5)  # eq. 6.49: widths scale by q, heights by p^2
        >>> round(float(law.q), 3), round(float(law.p**2), 3)
        (0.503, 0.436)
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
    """Return a point of the lobe with this slope, or with the nearest slope."""
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
        shifts: Shifts in the units of x, shape `(k,)`; the shifted map is the map at x
            + shift.
        turns: Number of iterations.
        keep: Number of final iterates to keep.

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


@program
def _iterate(local, shifts, turns, keep):
    def one(shift):
        def step(x, _):
            x = local(x + shift)
            return x, x

        return jax.lax.scan(step, local.alpha_inf, length=turns)[1][turns - keep :]

    return jax.vmap(one)(shifts)
