"""A hash of the source code, which reveals results computed by other versions."""

import functools
import hashlib
import importlib.util
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


_PACKAGES = ("jaxcam", "variational", "continuation")
_BENEATH = ("jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy", "matplotlib")
"""Packages whose versions affect the digits of results."""


@functools.cache
def source_mark() -> str:
    """Hash all source files of the project and the versions of its dependencies.

    The hash also changes if only a comment changes: an unnecessary computation costs
    only minutes, whereas a result of outdated code would be misleading.
    """
    folders = [folder for name in _PACKAGES for folder in _folders(name)]
    versions = [f"{name} {_version(name)}" for name in _BENEATH]
    return source_hash(folders, versions)


def source_hash(folders: list[Path], words: list[str]) -> str:
    """Hash the names and contents of the Python files in folders, and further words."""
    found = hashlib.sha256("\n".join(words).encode())
    for folder in folders:
        for file in sorted(folder.rglob("*")):
            if file.suffix in (".py", ".mplstyle", ".toml") and file.is_file():
                found.update(f"\n{file.relative_to(folder).as_posix()}\n".encode())
                found.update(file.read_bytes())
    return found.hexdigest()[:16]


def _folders(package: str) -> list[Path]:
    spec = importlib.util.find_spec(package)
    places = None if spec is None else spec.submodule_search_locations
    return [Path(place) for place in places or ()]


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "?"
