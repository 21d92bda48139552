"""Represent constants known for each recording as parameters that no fit changes."""

import difflib
import math
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...hybrid import HybridSystem
from ...parameters import parameter_names
from ...recordings import Recording, RecordingError
from ..own_systems import Field
from ._model import Model
from ._parameter import Parameter


def known_constants(
    model: Model, recordings: Sequence[Recording]
) -> tuple[Parameter, ...]:
    """Return a parameter for each name in the `constants` of recordings.

    If a recording does not state a constant, the value of the model is used.

    **Raises:** `RecordingError` if a name is not a number of the system, or a value is
    not a number.
    """
    names = dict.fromkeys(name for run in recordings for name in run.constants)
    found = []
    for name in names:
        stating = [run for run in recordings if name in run.constants]
        places = [_place(model.system, run, name) for run in stating]
        where = Field(f"system.{places[0]}")
        usual = float(where(model))
        values = tuple(float(one.constants.get(name, usual)) for one in recordings)
        found.append(Parameter(name, where, known=values))
    return tuple(found)


def with_constants(model: Model, recording: Recording) -> Model:
    """Return the model with the constants of one recording.

    **Raises:** see `known_constants`.
    """
    for name, value in recording.constants.items():
        where = Field(f"system.{_place(model.system, recording, name)}")
        number = jnp.asarray(value, dtype=float)
        model = eqx.tree_at(where, model, number)
    return model


def _place(system: HybridSystem, recording: Recording, name: str) -> str:
    """Return the full name of a number of the system, or of a wrapped system.

    If several parts have such a number, the outermost is used.
    """
    value = recording.constants[name]
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
        value = math.nan
    if not math.isfinite(value):
        raise RecordingError(
            f"{recording.name}: the constant `{name}` is not a finite number; correct "
            "it."
        )
    every = parameter_names(system)
    inside = [one for one in every if one == name or one.endswith(f".{name}")]
    if not inside:
        near = difflib.get_close_matches(name, every, n=1)
        hint = f"is `{near[0]}` meant?" if near else f"it has {', '.join(every)}."
        raise RecordingError(
            f"{recording.name}: the constant `{name}` is not a number of the system; "
            f"{hint}"
        )
    return min(inside, key=lambda one: one.count("."))
