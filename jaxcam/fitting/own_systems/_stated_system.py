"""Create a system from the values in a rig file."""

import difflib
import inspect
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp

from ...hybrid import HybridSystem
from ...hybrid.checks import NEEDS_VALUES, needs_values
from ...parameters import as_arrays, parameter_names
from ...recordings import RigError
from ...recordings.files import printable
from ._field import Field
from ._system_file import fault


Stated: TypeAlias = float | bool | str
"""A number, or any other value of a field."""


def stated_system(
    file: Path,
    cls: type[HybridSystem],
    values: Mapping[str, Stated],
    *,
    fitted: Collection[str] = (),
    measured: Mapping[str, float] = {},
) -> HybridSystem:
    """Return a system with some of its field values taken from a file.

    Args:
        file: The file, for messages.
        values: Values by field name. A dotted name belongs to a part of the system,
            which must then have a default.
        fitted: Names of the fields that must be numbers.
        measured: Fields that follow a channel, each with the value used if there is no
            default and no value in the file.

    Returns:
        The system.

    Raises:
        RigError: The system cannot be created; the message names the file, the field
            and the fix.
    """
    known = inspect.signature(cls).parameters
    for name in (*values, *measured):
        if name.partition(".")[0] not in known:
            raise _unknown(file, cls, name, list(known), name in values)
    given = {
        name: _as_declared(file, name, value, known[name], name in fitted)
        for name, value in values.items()
        if "." not in name
    }
    for name, at_rest in measured.items():
        if name in known and known[name].default is inspect.Parameter.empty:
            given.setdefault(name, at_rest)
    for name, one in known.items():
        named = one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)
        if named and one.default is inspect.Parameter.empty and name not in given:
            raise RigError(
                f"{file}: the field `{name}` of {cls.__name__} has no value; add it to "
                f"[parameters]."
            )
    try:
        system = as_arrays(cls(**given))
    except Exception as error:
        raise RigError(
            f"{file}: {cls.__name__} cannot be created from these values "
            f"({fault(error)}); correct [parameters]."
        ) from error
    names = parameter_names(system)
    inner = [name for name in values if "." in name]
    for name in (*fitted, *inner, *measured):
        if name not in names:
            raise _unknown(file, cls, name, names, name in values)
    for name in inner:
        number = jnp.asarray(values[name], dtype=float)
        system = eqx.tree_at(Field(name), system, number)
    _refuse_broken(file, system)
    return system


def _as_declared(
    file: Path, name: str, value: Stated, declared: inspect.Parameter, varies: bool
) -> Any:
    """Convert a value to the type of its field.

    **Raises:** `RigError` for text or a boolean in place of a number.
    """
    kind, default = declared.annotation, declared.default
    if isinstance(value, float):
        # a field declared as an integer, such as a number of teeth, may be a loop bound
        # and must stay an integer
        whole = kind in (int, "int") and value.is_integer()
        return int(value) if whole and not varies else value
    numbers = float | int | jax.Array
    number = isinstance(default, numbers) and not isinstance(default, bool)
    if number or kind in (float, int, jax.Array, "float", "int"):
        raise RigError(
            f"{file}: `{name}` in [parameters] is not a number; write it without "
            f"quotes, in SI units."
        )
    return value


def _unknown(
    file: Path, cls: type, name: str, known: list[str], listed: bool
) -> RigError:
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"is `{near[0]}` meant?" if near else f"it has {', '.join(known) or 'none'}."
    where = "[parameters]" if listed else "[drive] or [input]"
    return RigError(
        f"{file}: {where} contains `{printable(name)}`, but {cls.__name__} has no such "
        f"number; {hint}"
    )


def _refuse_broken(file: Path, system: HybridSystem) -> None:
    """Raise `RigError` for functions that fail or return arrays of the wrong shape."""
    name, count = type(system).__name__, len(system.state_names)
    if not count:
        raise RigError(
            f"{file}: {name} does not name its states; add state_names = "
            f'("position", "velocity") to the class.'
        )
    try:
        system.check()
    except ValueError as error:
        raise RigError(f"{file}: {str(error).rstrip('.')}.") from None
    except Exception as error:
        raise RigError(
            f"{file}: `check` of {name} fails ({fault(error)}); correct it."
        ) from error
    found = {}
    for function in ("vector_field", "gap", "impact"):
        at = jnp.zeros(()), jnp.zeros(count)
        try:
            found[function] = jax.eval_shape(getattr(system, function), *at).shape
        except NEEDS_VALUES as error:
            said = needs_values(f"`{function}` of {name}")
            raise RigError(f"{file}: {said}.") from error
        except Exception as error:
            raise RigError(
                f"{file}: `{function}` of {name} fails ({fault(error)}); correct it."
            ) from error
    gaps = found["gap"]
    wanted = {
        "vector_field": (count,),
        "gap": gaps if len(gaps) < 2 else (),
        "impact": (*gaps, count),
    }
    for function, shape in wanted.items():
        if found[function] != shape:
            raise RigError(
                f"{file}: `{function}` of {name} has the shape {found[function]}, but "
                f"{shape} is required for its {count} state names; correct it."
            )
