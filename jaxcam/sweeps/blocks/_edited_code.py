"""Hash the code of a user's system, which reveals results of an earlier version."""

import hashlib
import inspect
import json
import types

import equinox as eqx

from ._function_code import constant, DEPTH


CODE = "code of the system"
"""The name of the hash in the identity of a sweep."""

# the classes of these packages change only with their version
_SHIPPED = (
    *("jaxcam", "variational", "continuation", "equinox"),
    *("abc", "builtins", "collections", "typing"),
)


def code_of_system(system) -> str | None:
    """Return a hash of the functions of the user's classes in a system; `None` if there
    are no such classes.

    Functions and constants of the same file that these functions use are included. The
    hash is equal in another process.
    """
    classes: dict[str, type] = {}
    _collect(system, classes)
    if not classes:
        return None
    about = [[name, _about_class(cls)] for name, cls in sorted(classes.items())]
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


def _about_class(cls: type) -> list:
    found = []
    for name in sorted(vars(cls)):
        value = getattr(cls, name, None)
        parts = (value,)
        if isinstance(value, property):
            parts = (value.fget, value.fset)
        for one in parts:
            inner = inspect.unwrap(one) if callable(one) else one
            inner = getattr(inner, "__func__", inner)
            if isinstance(inner, types.FunctionType) and _own(inner, cls.__module__):
                found.append([name, _about_function(inner, set())])
    return found


def _own(function: types.FunctionType, module: str) -> bool:
    """Return whether a function is the user's, not one that a library generated."""
    return function.__module__ == module and function.__code__.co_filename != "<string>"


def _about_function(function: types.FunctionType, seen: set[int]) -> list:
    """Describe a function, and what it uses of the names in its file."""
    seen.add(id(function))
    about: list = [
        constant(function, DEPTH),
        constant(function.__defaults__, DEPTH),
        constant(function.__kwdefaults__, DEPTH),
    ]
    for name in sorted(_names(function.__code__)):
        value = function.__globals__.get(name)
        if isinstance(value, types.FunctionType):
            if value.__module__ == function.__module__ and id(value) not in seen:
                about.append([name, _about_function(value, seen)])
        elif value is not None and not isinstance(value, type | types.ModuleType):
            about.append([name, constant(value, DEPTH)])
    return about


def _names(code: types.CodeType) -> set[str]:
    """Return the global names that code uses, also inside of nested functions."""
    found = set(code.co_names)
    for value in code.co_consts:
        if isinstance(value, types.CodeType):
            found |= _names(value)
    return found
