"""Basins along a parameter, each attractor with one number throughout."""

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
    """What [`jaxcam.sweeps.follow_basins`][] returns."""

    values: np.ndarray
    basins: tuple[Basins, ...]
    numbers: tuple[np.ndarray, ...]
    """For each value, the number that each of its attractors has throughout."""
    shares: np.ndarray
    """(values, numbers) part of the states that ends on each; 0 where it is not met."""
    names: np.ndarray
    """(values, numbers) its name there, empty where it is not met."""


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
    """Basins at each value of a parameter, with attractors matched to those before.

    Args:
        where: The parameter, and its values in the order to go through.
        values: The parameter, and its values in the order to go through.
        most: Distance of two orbits, in units of the first scale, beyond which they are
            not the same attractor, moved. Pairs are chosen so that all distances
            together are smallest; the label may change, as it does where P(1,1) turns
            into P(2,2).
        out: Folder, in which there will be one sweep for each value.
        ?- everything else: a: - everything else: as for [`jaxcam.sweeps.basins`][].

    Raises:
        ValueError: as [`jaxcam.sweeps.basins`][].
    """
    section = as_section(system)
    picked = pick(where, section.system)
    values = as_values(values, 1)
    made: list[Basins] = []
    numbers: list[np.ndarray] = []
    # the latest that was seen of each attractor
    latest: list[np.ndarray] = []
    for k, value in enumerate(values):
        moved = eqx.tree_at(picked, section.system, jnp.asarray(value))
        own = eqx.tree_at(lambda s: s.system, section, moved)
        folder = None if out is None else Path(out) / f"{k:04d}"
        one = basins(own, grid, turns, out=folder, progress=progress, **options)
        pairs = match_orbits(latest, one.orbits, one.scale, most)
        given = np.empty(len(one.names), dtype=int)
        for i, orbit in enumerate(one.orbits):
            if i in pairs:
                given[i] = pairs[i]
                latest[given[i]] = orbit
            else:
                given[i] = len(latest)
                latest.append(orbit)
        made.append(one)
        numbers.append(given)
    shares = np.zeros((len(values), len(latest)))
    names = np.full((len(values), len(latest)), "", dtype=object)
    for k, (one, given) in enumerate(zip(made, numbers, strict=True)):
        for name, number in zip(one.names, given, strict=True):
            shares[k, number] = one.shares[name].share
            names[k, number] = name
    return FollowedBasins(values, tuple(made), tuple(numbers), shares, names)
