"""Group the options of a command: one dataclass per group, one field per option."""

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any, get_type_hints


def grouped(command: Callable[..., Any]) -> Callable[..., Any]:
    """Convert a command with dataclasses as parameters into one that typer accepts.

    Typer sees the fields of each dataclass as separate options, and the command
    receives the dataclass with their values.
    """
    kinds = get_type_hints(command, include_extras=True)
    groups = {name: kind for name, kind in kinds.items() if _is_group(kind)}
    signature = inspect.signature(command)
    flat = []
    for name, parameter in signature.parameters.items():
        if name in groups:
            flat += _options(groups[name])
        else:
            flat.append(parameter.replace(annotation=kinds[name]))

    @functools.wraps(command)
    def wrapper(**given: Any) -> Any:
        for name, kind in groups.items():
            fields = dataclasses.fields(kind)
            given[name] = kind(**{f.name: given.pop(f.name) for f in fields})
        return command(**given)

    wrapper.__signature__ = signature.replace(parameters=flat)  # pyright: ignore
    wrapper.__annotations__ = {one.name: one.annotation for one in flat}
    return wrapper


def _is_group(kind: Any) -> bool:
    return isinstance(kind, type) and dataclasses.is_dataclass(kind)


def _options(group: type) -> list[inspect.Parameter]:
    kinds = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(
            field.name,
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            default=field.default,
            annotation=kinds[field.name],
        )
        for field in dataclasses.fields(group)
    ]
