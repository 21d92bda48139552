"""Store a sweep on disk as a plain Zarr group, which xarray can open.

In addition to the data, the group contains the array `checksum(block)`: the CRC-32 of
each finished block, or -1 for an unfinished block. The checksum of a block is written
after its data, so that interrupted, lost or damaged blocks are detected.
"""

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray
import zarr

from ._checksums import (
    AXES,
    CHECKSUM,
    checksum,
    checksums,
    damaged,
    faults,
    open_store,
    read_block,
    stored_identity,
    TOGETHER,
    UNFINISHED,
    UNREADABLE,
)
from ._edited_code import CODE
from ._store import ordered, plain, StoreLayout, template


class OnDisk:
    """A store for blocks in a Zarr group; with `resume`, existing blocks are kept.

    Raises:
        ValueError: There is something else at the path.
    """

    def __init__(self, path: str | Path, layout: StoreLayout, resume: bool):
        self.layout = layout
        self.path = Path(path)
        if self.path.exists() and any(self.path.iterdir() if self.path.is_dir()
                                      else [True]):  # fmt: skip
            self._meet(resume)
        else:
            self._create()
        self._group = zarr.open_group(str(self.path), mode="r+")

    def finished(self) -> list[bool]:
        return [not word for word in faults(self._group)]

    def write(self, block: int, arrays: Mapping[str, np.ndarray]) -> None:
        first, last = self.layout.bounds(block)
        parts = ordered(self.layout, arrays)
        for name, array in parts.items():
            self._group[name][first:last] = array  # pyright: ignore
        self._group[CHECKSUM][block] = checksum(parts)  # pyright: ignore

    def read(self, block: int) -> dict[str, np.ndarray]:
        return read_block(self._group, block)

    def dataset(self) -> xarray.Dataset:
        return open_store(self.path)

    def add(self, extra: xarray.Dataset) -> None:
        if TOGETHER in self._group.attrs:
            del self._group.attrs[TOGETHER]
        for name in extra.variables:
            if (self.path / str(name)).exists():
                shutil.rmtree(self.path / str(name))
        # `to_zarr` replaces the attributes of the group by those of the added dataset
        attributes = {k: v for k, v in self._group.attrs.items() if k != TOGETHER}
        extra = extra.assign_attrs(attributes)
        extra.to_zarr(self.path, mode="a", consolidated=False, zarr_format=3)
        # written last, so that incomplete results are detected
        group = zarr.open_group(str(self.path), mode="r+")
        group.attrs[TOGETHER] = checksums(extra, extra.variables)

    def _create(self) -> None:
        layout = self.layout
        # build the group in a temporary folder next to the final one
        fresh = self.path.with_name(self.path.name + ".new")
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.parent.mkdir(parents=True, exist_ok=True)
        made = template(layout, {})
        made.to_zarr(fresh, mode="w", consolidated=False, zarr_format=3)
        group = zarr.open_group(str(fresh), mode="r+")
        group.attrs[AXES] = checksums(made, made.coords)
        for name, v in layout.variables.items():
            group.create_array(
                name,
                shape=(layout.units, *v.tail),
                chunks=(layout.block, *(max(1, k) for k in v.tail)),
                dtype=v.dtype,
                dimension_names=v.dims,
                attributes=dict(v.attributes),
            )
        group.create_array(
            CHECKSUM,
            shape=(layout.blocks,),
            chunks=(1,),
            dtype="int64",
            fill_value=UNFINISHED,
            dimension_names=("block",),
            attributes={"about": f"CRC-32 of each block; {UNFINISHED}: not finished"},
        )
        if self.path.is_dir():
            self.path.rmdir()
        fresh.rename(self.path)

    def _meet(self, resume: bool) -> None:
        """Check that the data at the path are those of this sweep, to be continued."""
        identity = stored_identity(self.path)
        if identity is None:
            raise ValueError(
                f"{self.path} contains something else; choose another folder"
            )
        wanted = plain(self.layout.identity)
        if identity != wanted:
            differing = [
                key
                for key in dict.fromkeys((*identity, *wanted))
                if identity.get(key) != wanted.get(key)
            ]
            edited = ""
            if {"system", CODE}.intersection(differing):
                edited = "delete it if you edited the system, "
            raise ValueError(
                f"{self.path} contains a different sweep (other "
                f"{', '.join(differing)}); {edited}choose another folder, or request "
                "the same sweep to continue it"
            )
        if not resume:
            raise ValueError(
                f"{self.path} already contains a sweep; pass resume=True to continue "
                "it, or choose another folder"
            )
        self._check_description()

    def _check_description(self) -> None:
        """Raise `ValueError` if the existing arrays do not have the expected layout."""
        layout = self.layout
        wanted = {
            name: ((layout.units, *v.tail), np.dtype(v.dtype))
            for name, v in layout.variables.items()
        }
        wanted[CHECKSUM] = ((layout.blocks,), np.dtype("int64"))
        try:
            group = zarr.open_group(str(self.path), mode="r")
            found = {
                name: (group[name].shape, group[name].dtype)  # pyright: ignore
                for name in wanted
            }
            sizes = (group.attrs["units"], group.attrs["block"], group.attrs["stored"])
            open_store(self.path).close()
        except UNREADABLE:
            raise damaged(self.path) from None
        if found != wanted or sizes != (
            layout.units,
            layout.block,
            [*layout.variables],
        ):
            raise damaged(self.path)
