"""Check that the files on disk are those that were written."""

import json
import warnings
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray
import zarr
import zarr.errors

from ._store import FORMAT, READABLE, SWEEP


UNFINISHED = -1
CHECKSUM = "checksum"
# attributes with the checksums of the combined results and of the coordinates (the loss
# of a coordinate would go unnoticed, because xarray would replace it by 0, 1, 2, ...)
TOGETHER, AXES = "together", "axes"
# exceptions of zarr and its codecs for damaged chunks and metadata
UNREADABLE = (OSError, ValueError, RuntimeError, TypeError, LookupError, AttributeError)


def faults(group: zarr.Group) -> list[str]:
    """Return a phrase on the fault of each block; empty if the block is intact."""
    units, size = int(group.attrs["units"]), int(group.attrs["block"])  # pyright: ignore
    found = []
    for block in range(-(-units // size)):
        try:
            wanted = int(np.asarray(group[CHECKSUM][block]))  # pyright: ignore
        except UNREADABLE:
            found.append("has an unreadable checksum")
            continue
        if wanted == UNFINISHED:
            found.append("is not finished")
            continue
        try:
            same = checksum(read_block(group, block)) == wanted
        except UNREADABLE:
            found.append("cannot be read")
            continue
        found.append("" if same else "is damaged")
    return found


def checksum(arrays: Mapping[str, np.ndarray]) -> int:
    """Compute the CRC-32 of the arrays of a block, in the order of the layout."""
    value = 0
    for array in arrays.values():
        value = zlib.crc32(np.ascontiguousarray(array).tobytes(), value)
    return value


def open_store(path: str | Path) -> xarray.Dataset:
    """Open the dataset on disk, which is read lazily.

    Raises:
        ValueError: The metadata or a coordinate is damaged.
    """
    try:
        with warnings.catch_warnings():
            # ignore warnings of missing metadata: lost parts are reported when needed
            warnings.simplefilter("ignore", zarr.errors.ZarrUserWarning)
            dataset = xarray.open_dataset(
                path, engine="zarr", consolidated=False, chunks=None, decode_times=False
            )
        wanted = dataset.attrs.get(AXES, {})
        whole = checksums(dataset, wanted) == dict(wanted)
    except UNREADABLE:
        whole = False
    if not whole:
        raise damaged(path)
    return dataset


def damaged(path: str | Path) -> ValueError:
    return ValueError(
        f"{path}: the description of the sweep (zarr.json, coordinates) is damaged; "
        "remove the folder, and run the sweep again"
    )


def read_block(group: zarr.Group, block: int) -> dict[str, np.ndarray]:
    size = int(group.attrs["block"])  # pyright: ignore
    some = slice(block * size, (block + 1) * size)
    stored = list(group.attrs["stored"])  # pyright: ignore
    return {str(name): np.asarray(group[str(name)][some]) for name in stored}  # pyright: ignore


def checked(path: str | Path) -> xarray.Dataset:
    """Open the dataset on disk after checking all its blocks.

    Raises:
        ValueError: Blocks are missing or damaged; the message names them.
    """
    if stored_identity(Path(path)) is None:
        raise ValueError(f"{path} is not a stored sweep; give the .zarr folder of one")
    wrong = faults(zarr.open_group(str(path), mode="r"))
    bad = [block for block, word in enumerate(wrong) if word]
    if bad:
        raise ValueError(
            f"{path}: block {bad[0]} {wrong[bad[0]]} ({len(bad)} of {len(wrong)} "
            f"blocks are wrong: {names_of(bad)}); run the sweep again with resume=True "
            "to recompute them"
        )
    dataset = open_store(path)
    _check_together(path, dataset)
    return dataset


def _check_together(path, dataset: xarray.Dataset) -> None:
    """Raise `ValueError` if the results for all blocks are missing or damaged."""
    about = f"{path}: the blocks are intact; run the sweep again with resume=True"
    wanted = dataset.attrs.get(TOGETHER)
    if wanted is None:
        if json.loads(dataset.attrs[SWEEP])["sweep"] == "basins":
            raise ValueError(f"{about} to find the attractors, which are missing")
        return
    try:
        found = checksums(dataset, wanted)
    except UNREADABLE:
        found = {}
    bad = [name for name in wanted if found.get(name) != wanted[name]]
    if bad:
        raise ValueError(
            f"{about} to recompute {', '.join(bad)}, whose checksums do not match"
        )


def checksums(dataset: xarray.Dataset, names) -> dict[str, int]:
    return {str(n): checksum({"": _plain(dataset[n].values)}) for n in names}


def _plain(values: np.ndarray) -> np.ndarray:
    """Convert text to bytes, independent of its representation in memory."""
    if values.dtype.kind in "biufc":
        return values
    return np.frombuffer("\n".join(map(str, values.ravel())).encode(), dtype=np.uint8)


def stored_identity(path: Path) -> dict | None:
    """Return the identity of the sweep at a path; None where there is no sweep."""
    try:
        attributes = dict(zarr.open_group(str(path), mode="r").attrs)
        if attributes.get("format") != FORMAT:
            return None
        if attributes.get("version") not in READABLE:
            return None
        identity = json.loads(str(attributes[SWEEP]))
        # the size of the blocks and the names of the arrays, needed to read the sweep
        whole = int(attributes["units"]) > 0 and int(attributes["block"]) > 0  # pyright: ignore
        stored = all(isinstance(name, str) for name in attributes["stored"])  # pyright: ignore
    except (*UNREADABLE, RecursionError):
        return None
    return identity if isinstance(identity, dict) and whole and stored else None


def names_of(blocks: Sequence[int]) -> str:
    """Return the numbers of the blocks as text that fits on one line."""
    shown = ", ".join(map(str, blocks[:8]))
    return shown if len(blocks) <= 8 else f"{shown} and {len(blocks) - 8} more"
