"""Hash the code of a user's system, which reveals results of an earlier version."""

import hashlib
import inspect
import json
import os
import sys
import types

import equinox as eqx
import jax
import numpy as np

from ._function_code import constant, DEPTH


CODE = "code of the system"
"""The name of the hash in the identity of a sweep."""

# the classes of these packages change only with their version
_SHIPPED = (
    *("jaxcam", "variational", "continuation", "equinox"),
    *("abc", "builtins", "collections", "typing"),
)
# kinds of constants that a class may contain
_CONSTANTS = (bool, int, float, complex, str, tuple, list, dict, np.ndarray, jax.Array)


def code_of_system(system) -> str | None:
    """Return a hash of the functions of the user's classes in a system; `None` if there
    are no such classes.

    The constants of the classes are included, and the functions, classes and constants
    that the functions use, if they are defined in a file of the same folder. The hash
    is equal in another process with the same version of Python.
    """
    classes: dict[str, type] = {}
    _collect(system, classes)
    if not classes:
        return None
    seen: set[int] = set()
    about = [[name, _about_class(cls, seen)] for name, cls in sorted(classes.items())]
    return hashlib.sha256(json.dumps(about).encode()).hexdigest()


def _collect(part, found: dict[str, type]) -> None:
    if isinstance(part, tuple | list):
        for one in part:
            _collect(one, found)
    if not isinstance(part, eqx.Module):
        return
    for cls in type(part).__mro__:
        if cls.__module__.split(".")[0] not in _SHIPPED:
            found[cls.__qualname__] = cls
    for name in getattr(part, "__dataclass_fields__", {}):
        _collect(getattr(part, name, None), found)


def _about_class(cls: type, seen: set[int]) -> list:
    seen.add(id(cls))
    found = []
    fields = getattr(cls, "__dataclass_fields__", {})
    for name in sorted(vars(cls)):
        value = getattr(cls, name, None)
        parts = (value,)
        if isinstance(value, property):
            parts = (value.fget, value.fset)
        elif isinstance(value, _CONSTANTS) and name not in fields:
            # dunder names, such as the module, say nothing about the motion
            if not name.startswith("__"):
                found.append([name, constant(value, DEPTH)])
        for one in parts:
            inner = inspect.unwrap(one) if callable(one) else one
            inner = getattr(inner, "__func__", inner)
            if isinstance(inner, types.FunctionType) and _own(inner, cls.__module__):
                found.append([name, _about_function(inner, seen)])
    return found


def _own(function: types.FunctionType, module: str) -> bool:
    """Return whether a function is the user's, not one that a library generated."""
    return function.__module__ == module and function.__code__.co_filename != "<string>"


def _folder(one: types.FunctionType | type) -> str:
    """Return the folder of the file in which a function or class is defined."""
    module = sys.modules.get(one.__module__)
    return os.path.dirname(getattr(module, "__file__", None) or one.__module__)


def _about_function(function: types.FunctionType, seen: set[int]) -> list:
    """Describe a function, and what it uses of the names in its folder."""
    seen.add(id(function))
    about: list = [
        constant(function, DEPTH),
        constant(function.__defaults__, DEPTH),
        constant(function.__kwdefaults__, DEPTH),
    ]
    for name in sorted(_names(function.__code__)):
        value = function.__globals__.get(name)
        if isinstance(value, types.FunctionType | type):
            if id(value) in seen or _folder(value) != _folder(function):
                continue
            if isinstance(value, type):
                about.append([name, _about_class(value, seen)])
            else:
                about.append([name, _about_function(value, seen)])
        elif value is not None and not isinstance(value, types.ModuleType):
            about.append([name, constant(value, DEPTH)])
    return about


def _names(code: types.CodeType) -> set[str]:
    """Return the global names that code uses, also inside of nested functions."""
    found = set(code.co_names)
    for value in code.co_consts:
        if isinstance(value, types.CodeType):
            found |= _names(value)
    return found
