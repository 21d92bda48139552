"""Compute basins along a parameter, with consistent attractor numbers."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ..parameters import pick
from ._basins import basins
from ._basins_result import Basins
from ._grid import Grid
from ._inputs import as_section, as_values
from .attractors import match_orbits
from .blocks import Progress


class FollowedBasins(NamedTuple):
    """The result of [`jaxcam.sweeps.follow_basins`][]."""

    values: np.ndarray
    """Values of the parameter."""
    basins: tuple[Basins, ...]
    """Basins at each value."""
    numbers: tuple[np.ndarray, ...]
    """Consistent numbers of the attractors at each value."""
    shares: np.ndarray
    """Fraction of the states that lead to each attractor, shape `(values, numbers)`; 0
    where it does not exist.
    """
    names: np.ndarray
    """Name of each attractor, shape `(values, numbers)`; empty where it does not exist.
    """


def follow_basins(
    system,
    where: Callable | str,
    values,
    grid: Grid,
    turns: int = 100,
    *,
    most: float = 0.2,
    out: str | Path | None = None,
    progress: Callable[[Progress], None] | None = None,
    **options,
) -> FollowedBasins:
    """Compute basins at each value of a parameter, and match attractors between values.

    Args:
        system: A hybrid system, or a section that is sampled once per period.
        where: The parameter: `lambda s: s.speed`, or `"speed"`.
        values: Values of the parameter, in the order in which basins are computed.
        grid: A [`jaxcam.sweeps.Grid`][] of initial states.
        turns: Number of periods simulated.
        most: Largest distance, in units of the scale of the motions, between the orbits
            of the same attractor at two successive values. Orbits are paired so that
            the sum of the distances is smallest; the label of an attractor may change,
            for example from P(1,1) to P(2,2).
        out: Folder in which a sweep is stored for each value.
        progress: As for [`jaxcam.sweeps.blocks.run_blocks`][], for one value at a
            time.
        options: As for [`jaxcam.sweeps.basins`][].

    Returns:
        A `FollowedBasins`.

    Raises:
        ValueError: See [`jaxcam.sweeps.basins`][].

    Examples:
        >>> from jaxcam import sweeps
        >>> cubic = sweeps.Map(lambda x, p: p["a"] * x - 0.5 * x**3, {"a": 1.5})
        >>> grid = sweeps.Grid([-1.0], [1.0], [10])
        >>> found = sweeps.follow_basins(cubic, "a", [1.4, 1.5], grid)
        >>> found.shares.tolist()
        [[0.5, 0.5], [0.5, 0.5]]
    """
    section = as_section(system)
    picked = pick(where, section.system)
    values = as_values(values)
    made: list[Basins] = []
    numbers: list[np.ndarray] = []
    # the numbers of the attractors at the previous value, and their orbits; one that
    # vanishes is not matched with whatever appears later
    count, before, latest = 0, np.zeros(0, dtype=int), ()
    for k, value in enumerate(values):
        moved = eqx.tree_at(picked, section.system, jnp.asarray(value))
        own = eqx.tree_at(lambda s: s.system, section, moved)
        folder = None if out is None else Path(out) / f"{k:04d}"
        one = basins(own, grid, turns, out=folder, progress=progress, **options)
        pairs = match_orbits(latest, one.orbits, one.scale, most)
        given = np.empty(len(one.names), dtype=int)
        for i in range(len(one.names)):
            given[i] = before[pairs[i]] if i in pairs else count
            count += i not in pairs
        before, latest = given, one.orbits
        made.append(one)
        numbers.append(given)
    shares = np.zeros((len(values), count))
    names = np.full((len(values), count), "", dtype=object)
    for k, (one, given) in enumerate(zip(made, numbers, strict=True)):
        for name, number in zip(one.names, given, strict=True):
            shares[k, number] = one.shares[name].share
            names[k, number] = name
    return FollowedBasins(values, tuple(made), tuple(numbers), shares, names)
