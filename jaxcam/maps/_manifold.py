"""Compute invariant manifolds of saddles of planar maps, starting from the saddle."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..hybrid.programs import program
from ..parameters import real_array, VectorLike


_NEWTON = 50
_MOST_POINTS = 20_000


class Saddle(NamedTuple):
    """A fixed point of a planar map with one multiplier inside and one outside the unit
    circle.

    Examples:
        >>> from jaxcam.maps import saddle_at
        >>> saddle_at(lambda x: jnp.stack([2 * x[0], x[1] / 2]), [0.1, 0.1]).point.shape
        (2,)
    """

    point: Float[Array, " 2"]
    """The fixed point, shape `(2,)`."""
    multipliers: Float[np.ndarray, " 2"]
    """Multipliers, stable one first, shape `(2,)`."""
    directions: Float[np.ndarray, "2 2"]
    """Eigenvectors as columns, shape `(2, 2)`."""


def saddle_at(system: Callable, guess: VectorLike) -> Saddle:
    """Find the saddle near a guess by Newton's method.

    Args:
        system: A planar map.
        guess: Initial guess for the saddle, shape `(2,)`.

    Returns:
        A [`jaxcam.maps.Saddle`][].

    Raises:
        ValueError: There is no fixed point, or it is not a saddle.

    Examples:
        >>> from jaxcam.maps import saddle_at
        >>> linear = lambda x: jnp.stack([2 * x[0], x[1] / 2])
        >>> saddle_at(linear, [0.1, 0.1]).multipliers.tolist()
        [0.5, 2.0]
    """
    point = real_array(guess, "guess")
    step = jnp.full(2, jnp.inf)
    for _ in range(_NEWTON):
        image, matrix = _linearised(system, point)
        step = jnp.linalg.solve(matrix - jnp.eye(2), image - point)
        point = point - step
        if not float(jnp.max(jnp.abs(step))) > 1e-13 * (1 + float(jnp.max(point))):
            break
    if not float(jnp.max(jnp.abs(step))) < 1e-9:
        raise ValueError("No fixed point was found; give a guess closer to it.")
    values, vectors = np.linalg.eig(np.asarray(_linearised(system, point)[1]))
    order = np.argsort(np.abs(values))
    values, vectors = values[order], vectors[:, order]
    if np.any(np.imag(values) != 0) or not np.abs(values[0]) < 1 < np.abs(values[1]):
        raise ValueError(
            f"The fixed point at {np.asarray(point).tolist()} has multipliers "
            f"{values[0]:.4g} and {values[1]:.4g}, so it is not a saddle; give "
            "another guess."
        )
    return Saddle(point, np.real(values), np.real(vectors))


def grow_manifold(
    system: Callable,
    point: VectorLike,
    direction: VectorLike,
    *,
    length: float,
    spacing: float = 0.01,
    start: float = 1e-5,
) -> Float[np.ndarray, "points 2"]:
    """Return one branch of the unstable manifold of a saddle, as a curve from the
    saddle.

    The curve consists of a short segment along the unstable direction and the images of
    that segment. Points are added to the segment wherever the images of neighbouring
    points are too far apart, so that every point of the curve is an exact image of a
    point on the segment, and folds are resolved. For the stable manifold, pass the
    inverse map.

    Args:
        system: The map, traceable by JAX.
        point: The saddle, shape `(2,)`.
        direction: Unstable direction, whose sign chooses the branch, shape `(2,)`.
        length: Length of the curve.
        spacing: Largest distance between neighbouring points.
        start: Distance from the saddle at which the curve begins; its square is the
            error.

    Returns:
        The points in order, shape `(points, 2)`. The curve ends where the map is not
            finite or jumps, since no refinement could bring neighbouring points
            together there.

    Raises:
        ValueError: The map does not expand along the direction.

    Examples:
        >>> from jaxcam.maps import grow_manifold
        >>> linear = lambda x: jnp.stack([2 * x[0], x[1] / 2])
        >>> curve = grow_manifold(linear, [0.0, 0.0], [1.0, 0.0], length=0.5)
        >>> curve.shape[1]
        2
    """
    point = np.asarray(point, dtype=float)
    unit = np.asarray(direction, dtype=float)
    unit = unit / np.linalg.norm(unit)
    matrix = np.asarray(_linearised(system, jnp.asarray(point))[1])
    stretch = float(unit @ matrix @ unit)
    if not abs(stretch) > 1:
        raise ValueError(
            f"The map stretches this direction by {stretch:.3g}; give the unstable "
            "direction of a saddle, or the inverse map for its stable manifold."
        )
    times = 2 if stretch < 0 else 1
    ratio = abs(stretch) ** times
    # equidistant in the logarithm of the distance from the saddle, because each
    # iteration of the map adds a constant to this logarithm
    fractions = np.linspace(0.0, 1.0, 24)
    pieces, grown, order = [point[None]], 0.0, 0
    total = 1
    while grown < length and total < _MOST_POINTS:
        fractions, images = _refined(
            system, point, unit, start, ratio, fractions, order * times, spacing
        )
        steps = np.linalg.norm(np.diff(images, axis=0), axis=1)
        far = np.flatnonzero(~(steps <= 4 * spacing))
        end = int(far[0]) + 1 if len(far) else len(images)
        pieces.append(images[:end])
        grown += float(np.sum(steps[: end - 1]))
        total += end
        if len(far):
            break
        order += 1
    return np.concatenate(pieces)


def _refined(system, point, unit, start, ratio, fractions, order, spacing):
    """Return images of the first segment, refined between points that are far apart."""

    def images(parts):
        first = point + start * ratio ** parts[:, None] * unit
        # few array lengths, so that few programs are compiled
        room = 64
        while room < len(first):
            room *= 2
        padded = np.concatenate([first, np.repeat(first[-1:], room - len(first), 0)])
        found = _images(system, jnp.asarray(padded), jnp.asarray(order))
        return np.asarray(found)[: len(first)]

    found = images(fractions)
    for _ in range(40):
        steps = np.linalg.norm(np.diff(found, axis=0), axis=1)
        wide = (steps > spacing) & (np.diff(fractions) > 1e-12)
        if not np.any(wide) or len(fractions) > _MOST_POINTS:
            break
        between = (fractions[:-1] + fractions[1:])[wide] / 2
        fractions = np.concatenate([fractions, between])
        found = np.concatenate([found, images(between)])
        order_of = np.argsort(fractions)
        fractions, found = fractions[order_of], found[order_of]
    return fractions, found


@program
def _images(system, points, order):
    def one(x):
        return jax.lax.fori_loop(0, order, lambda _, y: system(y), x)

    return jax.vmap(one)(points)


@program
def _linearised(system, point):
    return system(point), jax.jacfwd(system)(point)
