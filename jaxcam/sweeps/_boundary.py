"""Measure how basins are mixed, and how rough their boundary is."""

from typing import NamedTuple

import numpy as np


class BasinEntropy(NamedTuple):
    """Basin entropy and boundary basin entropy (nats)."""

    entropy: float
    """Average entropy of all boxes (nats)."""
    boundary_entropy: float
    """Average entropy of the boxes that contain a boundary (nats)."""

    @property
    def fractal(self) -> bool:
        """Return whether the boundary must be fractal (boundary entropy above ln 2)."""
        return bool(self.boundary_entropy > np.log(2))


class Uncertainty(NamedTuple):
    """The uncertainty exponent of a boundary, with its standard error."""

    exponent: float
    """The uncertainty exponent."""
    stderr: float
    """Standard error of the exponent."""
    dimension: float
    """Box-counting dimension of the boundary: that of the grid minus the exponent."""
    distance: np.ndarray
    """Distances used in the fit (cells)."""
    fraction: np.ndarray
    """Fraction of uncertain states at each `distance`."""


def basin_entropy(attractor, box: int = 5) -> BasinEntropy:
    """Return the basin entropy, the average entropy of the attractors within boxes.

    See Daza et al., Scientific Reports 6, 31416 (2016).

    Args:
        attractor: Numbers of attractors on a grid of any dimension; inadmissible states
            (-3) are omitted.
        box: Number of cells along each side of a box.

    Returns:
        A `BasinEntropy`; NaN if all states are inadmissible.

    Raises:
        ValueError: The box does not fit into the grid.

    Examples:
        >>> from jaxcam.sweeps import basin_entropy
        >>> chequered = np.indices((8, 8)).sum(0) % 2
        >>> round(basin_entropy(chequered, box=4).entropy, 4)  # ln 2
        0.6931
    """
    attractor = np.asarray(attractor)
    sides = [k // box for k in attractor.shape]
    if box < 2 or min(sides) < 1:
        raise ValueError(
            f"box is {box}, which must be 2 or more and fit into the grid "
            f"{attractor.shape}"
        )
    cut = attractor[tuple(slice(0, k * box) for k in sides)]
    shape = [part for k in sides for part in (k, box)]
    boxes = np.moveaxis(cut.reshape(shape), range(0, 2 * len(sides), 2),
                        range(len(sides)))  # fmt: skip
    boxes = boxes.reshape(int(np.prod(sides)), -1)
    known = [k for k in np.unique(boxes) if k != -3]
    if not known:
        return BasinEntropy(np.nan, np.nan)
    counts = np.stack([(boxes == k).sum(axis=1) for k in known])
    total = counts.sum(axis=0)
    counts, total = counts[:, total > 0], total[total > 0]
    p = counts / total
    entropy = -np.sum(np.where(p > 0, p * np.log(np.where(p > 0, p, 1.0)), 0.0), axis=0)
    mixed = (counts > 0).sum(axis=0) > 1
    boundary = float(entropy[mixed].mean()) if np.any(mixed) else 0.0
    return BasinEntropy(float(entropy.mean()), boundary)


def uncertainty_exponent(attractor, distances=(1, 2, 4, 8, 16)) -> Uncertainty:
    """Return the exponent with which the fraction of uncertain states decreases.

    A state is uncertain if another state at the given distance along an axis leads to a
    different attractor; the fraction of uncertain states scales as distance^exponent
    (McDonald et al., Physica D 17, 1985).

    Args:
        attractor: Numbers of attractors on a grid of any dimension; pairs with an
            inadmissible state (-3) are omitted.
        distances: Distances in cells; the longest must fit into the grid.

    Returns:
        An `Uncertainty`.

    Raises:
        ValueError: There are uncertain states at fewer than two distances.

    Examples:
        >>> from jaxcam.sweeps import uncertainty_exponent
        >>> halves = (np.arange(64)[:, None] < 32) * np.ones((1, 64), dtype=int)
        >>> round(uncertainty_exponent(halves).dimension, 1)  # a straight boundary
        1.0
    """
    attractor = np.asarray(attractor)
    axes = [axis for axis, k in enumerate(attractor.shape) if k > 1]
    # use the same states at all distances, so that the edges of the grid do not matter
    margin = max(distances)
    found = []
    for distance in distances:
        different = total = 0
        for axis in axes:
            part = np.moveaxis(attractor, axis, 0)
            one = part[:-margin]
            other = part[distance : distance + len(one)]
            known = (one != -3) & (other != -3)
            different += np.count_nonzero((one != other) & known)
            total += np.count_nonzero(known)
        if different:
            found.append((distance, different / total))
    if len(found) < 2:
        raise ValueError(
            "there are uncertain states at fewer than two distances; use a finer grid, "
            "or one that contains a basin boundary"
        )
    # imported here because it is slow to import
    from scipy.stats import linregress

    distance, fraction = map(np.array, zip(*found, strict=True))
    fit = linregress(np.log(distance), np.log(fraction))
    exponent = float(fit.slope)  # pyright: ignore
    error = float(fit.stderr)  # pyright: ignore
    return Uncertainty(exponent, error, len(axes) - exponent, distance, fraction)
