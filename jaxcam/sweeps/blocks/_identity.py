"""Describe the identity of a sweep as JSON, to compare it on resuming."""

import dataclasses
import functools
import hashlib
import inspect
import json
import types
from typing import Any

import equinox as eqx
import jax
import numpy as np

from ...models.saved import system_to_json
from ..sections import AbstractSection
from ._edited_code import CODE, code_of_system
from ._function_code import constant, content, DEPTH, function_code


def about_section(section: AbstractSection) -> dict[str, Any]:
    """Describe the section, with every parameter of its system."""
    found: dict[str, Any] = {"section": type(section).__name__}
    for field in dataclasses.fields(section):
        value = getattr(section, field.name)
        if field.name == "system":
            found["system"] = about_system(value)
            code = code_of_system(value)
            if code is not None:
                found[CODE] = code
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


def _about_function(function: Any) -> Any:
    """Describe a function by its name and a hash of its code, its defaults and the
    variables that it closes over, all of which are equal in another process.
    """
    if isinstance(function, functools.partial):
        parts = (function.func, function.args, function.keywords)
        return {"partial": [_plain(part) for part in parts]}
    name = getattr(function, "__qualname__", type(function).__name__)
    inner = inspect.unwrap(function)
    inner = getattr(inner, "__func__", inner)
    if not isinstance(inner, types.FunctionType):
        return name
    cells = [content(cell) for cell in inner.__closure__ or ()]
    # the object of a bound method
    own = getattr(function, "__self__", None)
    used = [*cells, inner.__defaults__, inner.__kwdefaults__, own]
    about = [
        function_code(inner.__code__, DEPTH),
        *(constant(one, DEPTH) for one in used),
    ]
    return {
        "function": name,
        "sha256": hashlib.sha256(json.dumps(about).encode()).hexdigest(),
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
        return _about_function(value)
    if dataclasses.is_dataclass(value):
        fields = dataclasses.fields(value)
        return {"class": type(value).__name__} | {
            f.name: _plain(getattr(value, f.name)) for f in fields
        }
    return type(value).__name__
