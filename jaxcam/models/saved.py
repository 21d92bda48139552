"""Save systems as JSON, with the name of the class and the parameters but no code.

```json
{"format": "jaxcam.system", "version": 1,
 "system": {"class": "BouncingBall",
            "fields": {"gravity": 9.81, "restitution": 0.8, ...}}}
```

A field is a number, a list of numbers, a string, another object of this kind, or a list
of such objects, written as `{"items": [...]}`.
"""

import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid import HybridSystem
from ._bilinear_oscillator import BilinearOscillator
from ._bouncing_ball import BouncingBall
from ._cam_follower import CamFollower
from ._dry_friction_oscillator import DryFrictionOscillator
from ._gear_backlash import GearBacklash
from ._impact_oscillator import ImpactOscillator
from ._restitution import ConstantRestitution, LinearInSpeed, PowerLawRestitution
from ._triple_integrator import TripleIntegrator
from .cams import EccentricCircle, FourierProfile, PiecewiseProfile, SplineProfile


_FORMAT, _VERSION = "jaxcam.system", 1
_LARGEST = 1e300
_MISFITS = (TypeError, AttributeError, LookupError, ArithmeticError, RecursionError)
_MISFIT = "the fields of `{}` do not fit together; save the system again."
_KNOWN: tuple[type, ...] = (
    BilinearOscillator,
    BouncingBall,
    CamFollower,
    ConstantRestitution,
    DryFrictionOscillator,
    EccentricCircle,
    FourierProfile,
    GearBacklash,
    ImpactOscillator,
    LinearInSpeed,
    PiecewiseProfile,
    PowerLawRestitution,
    SplineProfile,
    TripleIntegrator,
)


def save_system(
    system: HybridSystem, file: str | Path, *, about: dict[str, Any] | None = None
) -> None:
    """Write a system to a file as JSON.

    Args:
        system: The system.
        file: The file to write.
        about: Additional data to store, in plain JSON, such as the errors and the
            origin of the parameters.

    Raises:
        ValueError: A field of the system is not a number, an array, a string or another
            module.

    Examples:
        >>> from jaxcam.models import BouncingBall, load_system, save_system
        >>> save_system(BouncingBall(restitution=0.7), "ball.json")
        >>> float(load_system("ball.json").restitution)
        0.7
    """
    Path(file).write_text(
        json.dumps(system_to_json(system, about=about), indent=1) + "\n", "utf-8"
    )


def load_system(file: str | Path, *, classes: Iterable[type] = ()) -> HybridSystem:
    """Read a system written by `save_system`.

    Args:
        file: The file to read.
        classes: Classes that may occur in the file in addition to those of
            `jaxcam.models`, such as a system of your own, or
            `jaxcam.discrepancy.terms.saved_classes()`.

    Returns:
        The system.

    Raises:
        ValueError: The file is not a saved system, or contains an unknown class.

    Examples:
        >>> from jaxcam.models import BouncingBall, load_system, save_system
        >>> save_system(BouncingBall(), "ball.json")
        >>> type(load_system("ball.json")).__name__
        'BouncingBall'
    """
    file = Path(file)
    try:
        found = json.loads(file.read_text("utf-8"))
    except (ValueError, RecursionError):
        raise ValueError(
            f"{file}: this is not JSON; give a file written by `jaxcam fit` or "
            f"`save_system`."
        ) from None
    try:
        return system_from_json(found, classes=classes)
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def system_to_json(
    system: HybridSystem, *, about: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return a system as plain numbers, lists and strings; see `save_system`.

    Args:
        system: The system.
        about: Additional data to store, in plain JSON.

    Returns:
        A dictionary.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.models.saved import system_to_json
        >>> plain = system_to_json(BouncingBall(restitution=0.7))["system"]
        >>> plain["class"], plain["fields"]["restitution"]
        ('BouncingBall', 0.7)
    """
    found = {"format": _FORMAT, "version": _VERSION, "system": _encode(system, "")}
    return found if about is None else {**found, "about": about}


def system_from_json(found: Any, *, classes: Iterable[type] = ()) -> HybridSystem:
    """Return the system described by plain JSON; see `load_system`. Keys that are not
    part of the format are ignored.

    Args:
        found: The parsed JSON.
        classes: Classes that may occur in the description in addition to those of
            `jaxcam.models`.

    Returns:
        The system.

    Raises:
        ValueError: The description is invalid; the message gives the location.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.models.saved import system_from_json, system_to_json
        >>> plain = system_to_json(BouncingBall(restitution=0.7))
        >>> ball = system_from_json(plain)
        >>> type(ball).__name__, float(ball.restitution)
        ('BouncingBall', 0.7)
    """
    if not isinstance(found, dict) or found.get("format") != _FORMAT:
        raise ValueError(
            f'this is not a saved system: it lacks "format": "{_FORMAT}"; give a file '
            f"written by `jaxcam fit` or `save_system`."
        )
    if found.get("version") != _VERSION:
        raise ValueError(
            f"the file has version {_short(found.get('version'))}, but this program "
            f"reads {_VERSION}; update the program, or save the system again."
        )
    known = {cls.__name__: cls for cls in (*_KNOWN, *classes)}
    system = _decode(found.get("system"), known, "system")
    if not isinstance(system, HybridSystem):
        raise ValueError(
            f"{type(system).__name__} is not a HybridSystem; save a HybridSystem."
        )
    try:
        with np.errstate(all="ignore"):
            system.check()
    except _MISFITS:
        # raised for a string instead of a number, or a list instead of a law
        raise ValueError(_MISFIT.format("system")) from None
    return system


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:40]}..."


def _encode(value: Any, place: str) -> Any:
    if isinstance(value, eqx.Module):
        fields = {
            field.name: _encode(getattr(value, field.name), f"{place}.{field.name}")
            for field in dataclasses.fields(value)
        }
        return {"class": type(value).__name__, "fields": fields}
    if isinstance(value, jax.Array | np.ndarray | np.generic):
        return np.asarray(value).tolist()
    if isinstance(value, tuple):
        items = [_encode(one, f"{place}[{k}]") for k, one in enumerate(value)]
        return {"items": items}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise ValueError(
        f"`{place.lstrip('.')}` is a {type(value).__name__}, which cannot be saved; "
        f"use a module with numbers for it."
    )


def _decode(found: Any, known: dict[str, type], place: str) -> Any:
    if isinstance(found, list):
        try:
            return jnp.asarray(np.asarray(found, dtype=float))
        except (*_MISFITS, ValueError):
            raise ValueError(
                f"`{place}` is not a list of numbers; correct it."
            ) from None
    if isinstance(found, bool) or found is None or isinstance(found, str):
        return found
    if isinstance(found, int | float):
        if abs(found) > _LARGEST:
            raise ValueError(f"`{place}` is too large for a number; correct it.")
        return found
    if isinstance(found, dict) and set(found) == {"items"}:
        items = found["items"] if isinstance(found["items"], list) else []
        return tuple(
            _decode(one, known, f"{place}[{k}]") for k, one in enumerate(items)
        )
    if not isinstance(found, dict) or set(found) != {"class", "fields"}:
        raise ValueError(f"`{place}` needs a `class` and its `fields`.")
    name = found["class"]
    if not isinstance(name, str) or name not in known:
        raise ValueError(
            f"`{place}` is a {_short(name)}, which is unknown; if it is a class of "
            f"your own, pass it as classes=[...]."
        )
    cls = known[name]
    fields = {field.name: field for field in dataclasses.fields(cls)}
    given = found["fields"] if isinstance(found["fields"], dict) else {}
    # fields added since the file was written have defaults that preserve its meaning
    spare = {name for name, field in fields.items() if field.metadata.get("spare")}
    for wrong in sorted((set(given) ^ set(fields)) - spare):
        what = "lacks" if wrong in fields else "has an unknown field"
        raise ValueError(
            f"`{place}` {what} {_short(wrong)}; the fields of {name} are "
            f"{', '.join(fields)}."
        )
    made = object.__new__(cls)
    for key, field in fields.items():
        if key not in given:
            object.__setattr__(made, key, field.default)
            continue
        value = _decode(given[key], known, f"{place}.{key}")
        dynamic = not field.metadata.get("static", False)
        if dynamic and isinstance(value, int | float) and not isinstance(value, bool):
            value = jnp.asarray(value, dtype=float)
        object.__setattr__(made, key, value)
    check = getattr(made, "__check_init__", None)
    try:
        if check is not None:
            check()
    except _MISFITS:
        raise ValueError(_MISFIT.format(place)) from None
    return made
