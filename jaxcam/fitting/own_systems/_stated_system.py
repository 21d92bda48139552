"""Create a system from the values in a rig file."""

import difflib
import inspect
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp

from ...hybrid import HybridSystem, SwitchedSystem
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

    Examples:
        >>> from pathlib import Path
        >>> from jaxcam.fitting.own_systems import stated_system
        >>> from jaxcam.models import BouncingBall
        >>> ball = stated_system(Path("ball.toml"), BouncingBall, {"restitution": 0.6})
        >>> float(ball.restitution), float(ball.gravity)
        (0.6, 9.81)
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
    try:
        _ = system.period
    except Exception as error:
        raise _failing(file, f"`period` of {name}", error, system) from error
    at = jnp.zeros(()), jnp.zeros(count)
    # before `vector_field`, which calls `branch`
    if isinstance(system, SwitchedSystem):
        sides = jnp.ones(_shape(file, system, "switching", *at) or (1,))
        branch = _shape(file, system, "branch", *at, sides)
        _demand(file, system, "branch", branch, (count,))
    field = _shape(file, system, "vector_field", *at)
    gaps = _shape(file, system, "gap", *at)
    after = _shape(file, system, "impact", *at)
    _demand(file, system, "vector_field", field, (count,))
    _demand(file, system, "gap", gaps, gaps if len(gaps) < 2 else ())
    _demand(file, system, "impact", after, (*gaps, count))
    constraints, many = len(system.constraint_names), gaps[0] if gaps else 1
    if constraints not in (0, many):
        raise RigError(
            f"{file}: {name} has {constraints} `constraint_names`, but {_gaps(many)}; "
            f"give one name for each gap."
        )


def _demand(file: Path, system: HybridSystem, function: str, found, wanted) -> None:
    """Raise `RigError` if a function returns an array of the wrong shape."""
    if found != wanted:
        count = len(system.state_names)
        gaps = f" and {_gaps(wanted[0])}" if len(wanted) > 1 else ""
        raise RigError(
            f"{file}: `{function}` of {type(system).__name__} has the shape {found}, "
            f"but {wanted} is required for its {count} state names{gaps}; correct it."
        )


def _gaps(count: int) -> str:
    return f"{count} gap{'s' * (count != 1)}"


def _shape(file: Path, system: HybridSystem, function: str, *at) -> tuple[int, ...]:
    """Return the shape of the array that a function of the system returns.

    **Raises:** `RigError` if the function fails, or returns something else.
    """
    name = f"`{function}` of {type(system).__name__}"
    try:
        found = jax.eval_shape(getattr(system, function), *at)
    except NEEDS_VALUES as error:
        raise RigError(f"{file}: {needs_values(name)}.") from error
    except Exception as error:
        raise _failing(file, name, error, system) from error
    if found is None:
        raise RigError(f"{file}: {name} returns nothing; end it with `return`.")
    if not isinstance(found, jax.ShapeDtypeStruct):
        raise RigError(
            f"{file}: {name} returns a {type(found).__name__}; return an array, such "
            f"as `jnp.stack([...])`."
        )
    return found.shape


def _failing(file: Path, what: str, error: Exception, system) -> RigError:
    """Return an error that names the line of the file with the class."""
    source = inspect.getsourcefile(type(system))
    said = fault(error)
    if source is not None:
        said = f"{Path(source).name}: {fault(error, Path(source))}"
    return RigError(f"{file}: {what} fails ({said}); correct it.")
