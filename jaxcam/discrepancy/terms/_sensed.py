"""Contributions of terms to the reading of the first coordinate's sensor."""

import dataclasses
from collections.abc import Sequence

from ...fitting import Model, Parameter
from ._term import Motion, terms_of, watching
from ._where import Where
from ._with_terms import drive_at


def watched(model: Model) -> Model:
    """Return the model with the sensor errors among its terms added to the reading of
    the first coordinate's sensor.
    """
    if not any(Where.SENSOR in term.acts for term in terms_of(model)):
        return model
    name = watching(model)
    sensor = dataclasses.replace(model.sensors[name], error=_error)
    return dataclasses.replace(model, sensors={**model.sensors, name: sensor})


# Possible errors of any sensor
_FAULTS = ("gain", "offset", "lag")


def more_faults(model: Model, parameters: Sequence[Parameter]) -> list[Parameter]:
    """Return the gain, offset and lag of the first coordinate's sensor as parameters,
    except those that are parameters already.
    """
    known = set(own_faults(model, parameters))
    taken = [one.where(model) for one in parameters if one.name in known]
    sensor = model.sensors[watching(model)]
    return [
        Parameter(
            f"seen_{field}",
            lambda m, field=field: getattr(m.sensors[watching(m)], field),
        )
        for field in _FAULTS
        if not any(getattr(sensor, field) is one for one in taken)
    ]


def fitted_faults(
    model: Model, channel: str, parameters: Sequence[Parameter]
) -> set[str]:
    """Return which of the gain, offset and lag of a sensor are parameters."""
    sensor, found = model.sensors[channel], [one.where(model) for one in parameters]
    return {
        field
        for field in _FAULTS
        if any(one is getattr(sensor, field) for one in found)
    }


def own_faults(model: Model, parameters: Sequence[Parameter]) -> list[str]:
    """Return the names of the parameters that are the gain, offset or lag of the first
    coordinate's sensor.
    """
    sensor = model.sensors[watching(model)]
    fields = [getattr(sensor, field) for field in _FAULTS]
    return [
        one.name
        for one in parameters
        if any(one.where(model) is field for field in fields)
    ]


def _error(system, t, value, slope):
    motion = Motion(t, value, slope, *drive_at(system, t))
    acting = [term for term in system.terms if Where.SENSOR in term.acts]
    return sum(term.sensed(motion) for term in acting)
