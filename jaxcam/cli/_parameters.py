"""Parameters of a system by name: `profile.radius`, `restitution.slope`."""

import math
import re
from collections.abc import Callable, Collection, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid import HybridSystem
from ..models import CamFollower, ConstantRestitution
from ._corner_warning import warn_of_corners
from ._source import make_system, Source


# the cam speed, in rad/s here; the command line has an option for it, in rpm
_SPEED = "speed"
_CONSTANT = "restitution.r"


def make_model(
    name: str,
    preset: str | None,
    rpm: float | None,
    source: Source,
    assignments: Sequence[str] | None,
) -> HybridSystem:
    """Create a system with the parameters given on the command line.

    A warning is printed if a user's system is not smooth.

    Raises:
        ValueError: A name or value is invalid; the message says how to fix it.
    """
    system = make_system(name, preset, rpm, source)
    if source:
        warn_of_corners(system)
    return assign_parameters(system, assignments or ())


def parameters(system: HybridSystem) -> dict[str, float]:
    """Return all parameters and their values, in SI units."""
    return {name: _plain(leaf) for name, leaf in _leaves(system).items()}


def full_name(name: str, known: Collection[str]) -> str:
    """Return the full name of a parameter given by the end of its name, as in
    `frequency` for `base.frequency`, if no other name ends like it.
    """
    ends = [one for one in known if one.endswith(f".{name}")]
    return ends[0] if name not in known and len(ends) == 1 else name


def chosen_parameter(system: HybridSystem, name: str) -> str:
    """Return the full name of the parameter given by `--parameter`.

    Raises:
        ValueError: There is no such parameter that is a single number.
    """
    found = parameters(system)
    known = [one for one, value in found.items() if not isinstance(value, list)]
    name = full_name(name, known)
    if name not in known:
        missing = (
            "Give the parameter to vary with --parameter NAME"
            if name == _SPEED
            else f"--parameter {name} does not exist"
        )
        raise ValueError(f"{missing}; the parameters are: {', '.join(known)}.")
    return name


def assign_parameters(system: HybridSystem, assignments: Sequence[str]) -> HybridSystem:
    """Return the system with new values of some of its parameters.

    Each assignment is a text `name=value`. For example, `restitution.r=0.6` gives a
    cam-follower a constant coefficient of restitution.

    Raises:
        ValueError: A name is not a parameter, or a value is not a number.
    """
    for assignment in assignments:
        name, value = _split(assignment)
        if name == _CONSTANT and isinstance(system, CamFollower):
            law = ConstantRestitution(jnp.asarray(value, dtype=float))
            system = eqx.tree_at(lambda s: s.restitution, system, law)
            continue
        leaves = _leaves(system)
        name = full_name(name, leaves)
        if name == _SPEED and name in leaves and _in_rpm(system):
            raise ValueError(f"--set {assignment}: use --speed, with the speed in rpm.")
        if name not in leaves:
            raise ValueError(
                f"--set {assignment}: there is no parameter {name!r}; the parameters "
                f"are {', '.join(_names(system, leaves))}."
            )
        number = jnp.full_like(leaves[name], value)
        system = eqx.tree_at(pick_by_name(name), system, number)
    return system


def pick_by_name(name: str) -> Callable[[Any], Any]:
    """Return a function that picks a parameter by its name, such as `terms[0].c1`."""

    def where(system):
        for part in re.findall(r"[^.\[\]]+", name):
            inside = isinstance(system, tuple)
            system = system[int(part)] if inside else getattr(system, part)
        return system

    return where


def _in_rpm(system: HybridSystem) -> bool:
    """Return whether the speed of a system is given in rpm on the command line."""
    return isinstance(getattr(system, "base", system), CamFollower)


def _split(assignment: str) -> tuple[str, float]:
    name, equals, text = assignment.partition("=")
    if not equals or not name.strip():
        raise ValueError(
            f"--set {assignment}: give a name and a value, such as restitution.r=0.6."
        )
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(
            f"--set {assignment}: {text.strip() or 'an empty value'} is not a finite "
            f"number; give one, such as {name.strip()}=0.6."
        )
    return name.strip(), value


def _leaves(system) -> dict[str, jax.Array]:
    kept = eqx.filter(system, eqx.is_inexact_array)
    found, _ = jax.tree_util.tree_flatten_with_path(kept)
    names = (jax.tree_util.keystr(path).lstrip(".") for path, _ in found)
    # the speed keeps its short name if terms are added to the system
    names = [_SPEED if name == f"base.{_SPEED}" else name for name in names]
    return dict(zip(names, (leaf for _, leaf in found)))


def _names(system, leaves) -> list[str]:
    names = [name for name in leaves if name != _SPEED or not _in_rpm(system)]
    if isinstance(system, CamFollower) and _CONSTANT not in names:
        names.append(f"{_CONSTANT} (a constant coefficient)")
    return names


def _plain(leaf):
    return np.asarray(leaf).tolist()
