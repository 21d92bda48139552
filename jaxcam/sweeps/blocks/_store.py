"""Stores for the blocks of a sweep, and their layout."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import xarray


SWEEP = "sweep"
"""Name of the attribute with the description of the sweep."""
FORMAT, VERSION = "jaxcam sweep", 2
# version 1 differs only in the description of functions, by their names alone
READABLE = (1, VERSION)


class StoredVariable(NamedTuple):
    """One array of a sweep, with the blocks along its first dimension."""

    dims: tuple[str, ...]
    """Names of the dimensions."""
    tail: tuple[int, ...]
    """Shape without the first dimension."""
    dtype: Any
    """Type of the numbers."""
    attributes: Mapping[str, Any] = {}
    """Attributes, such as units."""


class StoreLayout(NamedTuple):
    """Layout of a stored sweep: `units` along the first dimension, in blocks of
    `block`.
    """

    units: int
    """Length of the first dimension."""
    block: int
    """Number of units per block."""
    variables: Mapping[str, StoredVariable]
    """Arrays by name."""
    coordinates: Mapping[str, tuple[str, Any, Mapping[str, Any]]]
    """Dimension, values and attributes of each coordinate."""
    identity: Mapping[str, Any]
    """Description of the sweep, as JSON; equal for equal sweeps."""

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return -(-self.units // self.block)

    def bounds(self, block: int) -> tuple[int, int]:
        """Return the first unit of a block, and the one after its last."""
        return block * self.block, min((block + 1) * self.block, self.units)


@runtime_checkable
class Store(Protocol):
    """A store for blocks."""

    layout: StoreLayout

    def finished(self) -> list[bool]: ...
    def write(self, block: int, arrays: Mapping[str, np.ndarray]) -> None: ...
    def read(self, block: int) -> dict[str, np.ndarray]: ...
    def dataset(self) -> xarray.Dataset: ...
    def add(self, extra: xarray.Dataset) -> None: ...


class Memory:
    """A store that keeps blocks in memory."""

    def __init__(self, layout: StoreLayout):
        self.layout = layout
        self._arrays = {
            name: np.zeros((layout.units, *v.tail), dtype=v.dtype)
            for name, v in layout.variables.items()
        }
        self._done = [False] * layout.blocks
        self._extra = xarray.Dataset()

    def finished(self) -> list[bool]:
        return list(self._done)

    def write(self, block: int, arrays: Mapping[str, np.ndarray]) -> None:
        first, last = self.layout.bounds(block)
        for name, array in ordered(self.layout, arrays).items():
            self._arrays[name][first:last] = array
        self._done[block] = True

    def read(self, block: int) -> dict[str, np.ndarray]:
        first, last = self.layout.bounds(block)
        return {name: a[first:last] for name, a in self._arrays.items()}

    def dataset(self) -> xarray.Dataset:
        made = template(self.layout, self._arrays)
        return made.merge(self._extra, combine_attrs="no_conflicts")

    def add(self, extra: xarray.Dataset) -> None:
        self._extra = extra


def ordered(layout: StoreLayout, arrays) -> dict[str, np.ndarray]:
    return {
        name: np.ascontiguousarray(arrays[name], dtype=v.dtype)
        for name, v in layout.variables.items()
    }


def template(layout: StoreLayout, arrays: Mapping[str, np.ndarray]) -> xarray.Dataset:
    """Return a dataset with the coordinates and attributes of a layout, and arrays."""
    data = {}
    for name, array in arrays.items():
        variable = layout.variables[name]
        data[name] = (variable.dims, array, dict(variable.attributes))
    coordinates = {
        name: (dim, values, dict(attributes))
        for name, (dim, values, attributes) in layout.coordinates.items()
    }
    attributes = {
        "format": FORMAT,
        "version": VERSION,
        "units": layout.units,
        "block": layout.block,
        "stored": list(layout.variables),
        SWEEP: json.dumps(plain(layout.identity)),
    }
    return xarray.Dataset(data, coordinates, attributes)


def plain(value: Any) -> Any:
    return json.loads(json.dumps(value))
