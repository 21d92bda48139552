"""Select parameters of a system inside a `WithTerms`."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from ...fitting import Input, Model, Parameter, Sensor, Turning
from ...fitting.engine import state_channels, state_size
from ...recordings import Recording
from ..terms import Term


@dataclasses.dataclass(frozen=True)
class OfBase:
    """A function that selects a field of the base of a `WithTerms`.

    Equal functions compare equal, so that diagnoses of one rig share compiled programs.
    """

    pick: Callable

    def __call__(self, system):
        return self.pick(system.base)


def of_base(drive: Turning | Input | None) -> Turning | Input | None:
    """Return the drive of the base of a `WithTerms`."""
    if isinstance(drive, Input):
        return Input(drive.channel, OfBase(drive.value), drive.interpolation)
    if drive is not None:
        acceleration = drive.acceleration and OfBase(drive.acceleration)
        return Turning(OfBase(drive.speed), OfBase(drive.phase), acceleration)
    return None


def within(parameter: Parameter) -> Parameter:
    """Return a parameter of a system, applied to the base of a `WithTerms`."""

    def where(model):
        return parameter.where(Model(model.system.base, model.sensors, model.drive))

    return dataclasses.replace(parameter, where=where)


def channel_of(sensors: Mapping[str, Sensor], place: int) -> str:
    """Return the channel that measures a state component, or else the first channel."""
    for name, sensor in sensors.items():
        if isinstance(sensor.observe, int) and sensor.observe == place:
            return name
    return next(iter(sensors))


def usual_state(
    system, sensors: Mapping[str, Sensor], runs: Sequence[Recording]
) -> Float[np.ndarray, " n"]:
    """Return the median of each measured component of the state; zero for others."""
    model = Model(system, sensors)
    state = np.zeros(state_size(model))
    for name, observe in state_channels(model).items():
        if isinstance(observe, int):
            samples = np.concatenate([run[name] for run in runs])
            state[observe] = np.nanmedian(samples)
    return state


def measured_in(unit: str, terms: Sequence[Term]) -> tuple[Term, ...]:
    """Return the terms with the given unit of the coordinate."""
    return tuple(dataclasses.replace(term, motion_unit=unit or "1") for term in terms)
