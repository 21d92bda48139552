"""Describe the identity of a sweep as JSON, to compare it on resuming."""

import dataclasses
import hashlib
from typing import Any

import equinox as eqx
import jax
import numpy as np

from ...models.saved import system_to_json
from ..sections import AbstractSection


def about_section(section: AbstractSection) -> dict[str, Any]:
    """Describe the section, with every parameter of its system."""
    found: dict[str, Any] = {"section": type(section).__name__}
    for field in dataclasses.fields(section):
        value = getattr(section, field.name)
        if field.name == "system":
            found["system"] = about_system(value)
        elif field.name not in ("regular", "impacting", "components"):
            found[field.name] = _plain(value)
    return found


def about_system(system) -> Any:
    """Describe a system, or the parameters of a map, by its classes and numbers."""
    if isinstance(system, eqx.Module):
        try:
            return system_to_json(system)["system"]  # pyright: ignore
        except ValueError:
            pass
    return _plain(system)


def digest(array) -> dict[str, Any]:
    """Describe an array by its shape and a hash, if it is too long to be listed."""
    array = np.ascontiguousarray(np.asarray(array, dtype=float))
    return {
        "shape": list(array.shape),
        "sha256": hashlib.sha256(array.tobytes()).hexdigest(),
    }


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        return np.asarray(value).tolist()
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if callable(value):
        # the name alone, because a memory address would differ between runs
        return getattr(value, "__qualname__", type(value).__name__)
    if dataclasses.is_dataclass(value):
        fields = dataclasses.fields(value)
        return {"class": type(value).__name__} | {
            f.name: _plain(getattr(value, f.name)) for f in fields
        }
    return type(value).__name__
