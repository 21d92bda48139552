"""Describe the code of functions, without names of files and line numbers."""

import json
import types
from typing import Any

import jax
import numpy as np


# how far the objects that a function uses are followed
DEPTH = 4


def content(cell: types.CellType) -> Any:
    """Return the variable of a cell; None if it is not assigned yet."""
    try:
        return cell.cell_contents
    except ValueError:
        return None


def function_code(code: types.CodeType, depth: int) -> list:
    """Describe compiled code, without the names of files and the line numbers."""
    constants = [constant(value, depth) for value in code.co_consts]
    return [code.co_code.hex(), constants, list(code.co_names)]


def constant(value: Any, depth: int) -> Any:
    """Describe a constant of a function, or a variable that it closes over.

    Objects are followed to a `depth`, because they can refer to each other.
    """
    if value is None or isinstance(value, bool | int | float | complex | str | bytes):
        return repr(value)
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        return repr(np.asarray(value).tolist())
    if depth == 0 or isinstance(value, type | types.ModuleType):
        return getattr(value, "__name__", type(value).__name__)
    if isinstance(value, types.CodeType):
        return function_code(value, depth - 1)
    if isinstance(value, tuple | list):
        return [constant(one, depth - 1) for one in value]
    if isinstance(value, dict):
        return {str(k): constant(one, depth - 1) for k, one in value.items()}
    if isinstance(value, frozenset | set):
        # their order differs between processes
        return sorted(json.dumps(constant(one, depth - 1)) for one in value)
    if isinstance(value, types.FunctionType):
        cells = [content(cell) for cell in value.__closure__ or ()]
        about = [constant(one, depth - 1) for one in cells]
        return [function_code(value.__code__, depth - 1), about]
    about = constant(getattr(value, "__dict__", {}), depth - 1)
    return [type(value).__name__, about]
