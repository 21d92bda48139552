"""The model to fit: a system, its drive and its sensors."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...hybrid import HybridSystem
from ._output import Output


def _array(value) -> Array:
    return jnp.asarray(value, dtype=float)


def _number(default: float):
    return eqx.field(default=default, converter=_array)


def _sorted(sensors: Mapping[str, Any]) -> dict[str, Any]:
    # as JAX sorts a dictionary, so that the channels have the same order everywhere
    return dict(sorted(sensors.items()))


class Sensor(eqx.Module):
    """A sensor: the map from the state x(t) to one channel of a recording.

    The sensor measures `offset + gain * observe(x(t - lag))`, passed through a
    first-order filter if the sensor has a bandwidth. White noise is added, and the
    result is rounded to the resolution and saturated at the limit. The likelihood
    accounts for rounding and saturation: a rounded sample only implies that the value
    is within an interval, a saturated one only that it is beyond the limit. Gain,
    offset and lag can be fitted like parameters of the system.

    Examples:
        >>> from jaxcam.fitting import Sensor
        >>> round(float(Sensor(0, noise=3e-3, resolution=1e-3).floor), 6)
        0.003014
    """

    observe: int | Output | Callable[[Array], Array] = eqx.field(static=True)
    """Index of a state component, a function of the state, or an `Output`."""
    noise: Float[Array, ""] = eqx.field(converter=_array)
    """Standard deviation of the noise, in the units of the channel."""
    resolution: float = eqx.field(default=0.0, static=True)
    """Resolution of the channel; zero if it is continuous."""
    limit: float = eqx.field(default=float("inf"), static=True)
    """Magnitude at which the channel saturates."""
    bandwidth_hz: float = eqx.field(default=float("inf"), static=True)
    """Bandwidth of a first-order filter (Hz); infinite if there is no filter."""
    tails: float = eqx.field(default=float("inf"), static=True)
    """Degrees of freedom of a Student t distribution for noise with outliers; infinite
    for Gaussian noise.
    """
    gain: Float[Array, ""] = _number(1.0)
    """Gain of the channel."""
    offset: Float[Array, ""] = _number(0.0)
    """Offset, in the units of the channel."""
    lag: Float[Array, ""] = _number(0.0)
    """Lag (s). It must be short compared with the time scale of the motion, apart from
    the part that has been removed from the recordings: see `removed_lag`."""
    removed_lag: Float[Array, ""] = _number(0.0)
    """Part of the lag (s) that the recordings no longer contain, because the samples of
    the channel have been moved."""
    error: Callable | None = eqx.field(default=None, static=True)
    """Systematic error added to the sensor reading in a fit: a function `error(system,
    t, value, slope)`, where `slope` is the rate of change of `value`; default: none.
    """

    def __check_init__(self):
        if not self.noise > 0:
            raise ValueError(
                f"The `noise` of a sensor is {self.noise}; make it positive."
            )
        if not self.bandwidth_hz > 0:
            raise ValueError(
                f"The `bandwidth_hz` of a sensor is {self.bandwidth_hz}; make it "
                "positive."
            )

    @property
    def floor(self) -> Float[Array, ""]:
        """Standard deviation of noise and rounding combined."""
        return jnp.sqrt(self.noise**2 + self.resolution**2 / 12)

    @property
    def remaining_lag(self) -> Float[Array, ""]:
        """Lag that the recordings contain (s)."""
        return self.lag - self.removed_lag

    @property
    def filtered(self) -> bool:
        """Whether the sensor has a limited bandwidth."""
        return self.bandwidth_hz != float("inf")

    @property
    def in_flight_only(self) -> bool:
        """Whether the channel contains no information on the motion in contact: the
        state of a filter is not known there, and an output omits the contact force.
        """
        return self.filtered or isinstance(self.observe, Output)

    def seen(self, system: HybridSystem, t, state: Float[Array, " n"]) -> Array:
        """Return the measured quantity for a state, before gain and offset are
        applied.
        """
        if isinstance(self.observe, int):
            return state[self.observe]
        if isinstance(self.observe, Output):
            return self.observe(system, t, state)
        return jnp.asarray(self.observe(state))


# NumPy arrays while the pieces are assembled, JAX arrays in the compiled programs
Numbers: TypeAlias = Array | np.ndarray


class DriveState(NamedTuple):
    """The motion of a drive at one time or in one step, or the level of an input."""

    angle: Numbers
    """Angle of the encoder (rad), or level of the input."""
    rate: Numbers
    """Rate of the drive (rad/s), or slope of the input."""
    acceleration: Numbers
    """Angular acceleration of the drive (rad/s^2)."""


class Turning(eqx.Module):
    """A drive whose motion is measured, with the system fields for its speed and phase.

    When a recording is predicted, the speed field is set to the measured speed, and the
    phase field such that the drive angle is the measured angle plus the `phase` of the
    fitted system. This `phase` is therefore the offset of the drive angle from the
    encoder reading. A system whose vector field depends on the acceleration of the
    drive, such as one on a base that the drive shakes, needs a field for this
    acceleration; its value is zero unless a recording is predicted. Without this field,
    the effect of the acceleration is treated as a random error of the motion.

    Examples:
        >>> from jaxcam.fitting import Turning
        >>> from jaxcam.models import preset
        >>> drive = Turning(lambda s: s.speed, lambda s: s.phase)
        >>> float(drive.speed(preset("calibrated"))) > 0
        True
    """

    speed: Callable[[HybridSystem], Array] = eqx.field(static=True)
    """Selects the speed field of the system, such as `lambda s: s.speed`."""
    phase: Callable[[HybridSystem], Array] = eqx.field(static=True)
    """Selects the phase field of the system, such as `lambda s: s.phase`."""
    acceleration: Callable[[HybridSystem], Array] | None = eqx.field(
        static=True, default=None
    )
    """Selects the field of the angular acceleration of the drive (rad/s^2), such as
    `lambda s: s.acceleration`.
    """

    def at(self, system, t, drive: DriveState):
        """Return the system with its drive in a given motion at time `t`."""
        phase = self.phase(system) + drive.angle - drive.rate * t
        system = eqx.tree_at(
            lambda s: (self.speed(s), self.phase(s)), system, (drive.rate, phase)
        )
        if self.acceleration is None:
            return system
        return eqx.tree_at(self.acceleration, system, jnp.asarray(drive.acceleration))


# What an input does between two samples
INTERPOLATIONS = "hold", "linear"


class Input(eqx.Module):
    """A measured input, such as a force or a voltage, and the system field for it.

    When a recording is predicted, the field follows the input in that recording.
    Between two samples, the input either keeps the value of the first one (`"hold"`, as
    at the output of a digital controller) or is interpolated (`"linear"`, as suits a
    continuous quantity such as the reading of a force transducer). If a continuous
    input is held, it is late by half a sampling interval. Within each integration step,
    the input is linear, with the mean and the first moment of this curve.

    Examples:
        >>> from jaxcam.fitting import Input
        >>> Input("force_N", lambda s: s.force, "linear").channel
        'force_N'
    """

    channel: str = eqx.field(static=True)
    """Channel of the recordings that contains the input."""
    value: Callable[[HybridSystem], Array] = eqx.field(static=True)
    """Selects the field of the system, such as `lambda s: s.force`."""
    interpolation: str = eqx.field(static=True, default="hold")
    """`"hold"` or `"linear"`: the input between two samples."""

    def __check_init__(self):
        if self.interpolation not in INTERPOLATIONS:
            raise ValueError(
                f"The `interpolation` of an input is {self.interpolation!r}; write "
                f"{' or '.join(map(repr, INTERPOLATIONS))}."
            )

    def slopes(self, time, level) -> np.ndarray:
        """Return the slope of the input after each sample; zero after the last."""
        if self.interpolation == "hold":
            return np.zeros(len(level))
        return np.append(np.diff(level) / np.diff(time), 0.0)

    def at(self, system, t, drive: DriveState):
        """Return the system with its input at a given level."""
        del t
        return eqx.tree_at(self.value, system, drive.angle)

    def during(self, system, middle, drive: DriveState):
        """Return the system as a function of time, within a step."""

        def at(t):
            level = drive.angle + drive.rate * (t - middle)
            return self.at(system, t, drive._replace(angle=level))

        return at


class Model(eqx.Module):
    """A system with its sensors and its drive or input.

    The `where` of each [`jaxcam.fitting.Parameter`][] selects a number in the model.

    Examples:
        >>> from jaxcam.fitting import Model, Sensor
        >>> from jaxcam.models import BouncingBall
        >>> list(Model(BouncingBall(), {"height_m": Sensor(0, noise=1e-3)}).sensors)
        ['height_m']
    """

    system: HybridSystem
    """Any `HybridSystem`."""
    sensors: Mapping[str, Sensor] = eqx.field(converter=_sorted)
    """A `Sensor` for each fitted channel, in alphabetical order."""
    drive: Turning | Input | None = None
    """The measured drive or input of the system, if there is one."""

    @property
    def sees_acceleration(self) -> bool:
        """Whether the system has a field for the acceleration of its drive."""
        return isinstance(self.drive, Turning) and self.drive.acceleration is not None

    def driven(self, t, drive: DriveState) -> HybridSystem:
        """Return the system with its drive or input as measured at time `t`."""
        if self.drive is None:
            return self.system
        return self.drive.at(self.system, t, drive)

    def uniform(self, angle, rate) -> HybridSystem:
        """Return the system with its drive turning uniformly at a rate (rad/s); `angle`
        is the encoder angle (rad) at time zero.
        """
        # arrays, because numbers would be compiled as constants, with a separate
        # program for each recording
        state = DriveState(*(jnp.asarray(x, float) for x in (angle, rate, 0.0)))
        return self.driven(0.0, state)

    def during(self, middle, drive: DriveState) -> Callable[[Array], HybridSystem]:
        """Return the system as a function of time, within a step about `middle`.

        Within a step, a drive turns uniformly, so the system is the same throughout.
        """
        if isinstance(self.drive, Input):
            return self.drive.during(self.system, middle, drive)
        system = self.driven(middle, drive)
        return lambda t: system


def cam_follower_drive() -> Turning:
    """Return the drive of a `CamFollower`.

    Returns:
        A [`jaxcam.fitting.Turning`][].

    Examples:
        >>> from jaxcam.fitting.engine import cam_follower_drive
        >>> from jaxcam.models import preset
        >>> rig, drive = preset("calibrated"), cam_follower_drive()
        >>> round(float(drive.speed(rig)) * 30 / np.pi, 1)  # rpm
        145.0
    """
    return _CAM_DRIVE


def _speed(system):
    return system.speed


def _phase(system):
    return system.phase


# one object, so that models of the same kind share compiled programs
_CAM_DRIVE = Turning(_speed, _phase)


def filtered_channels(model: Model) -> tuple[str, ...]:
    """Return the channels whose sensor has a bandwidth and therefore a filter state."""
    return tuple(name for name in model.sensors if model.sensors[name].filtered)


def measured_components(model: Model) -> dict[str, int]:
    """Return the channels that show one component of the state without a filter, and
    its index.
    """
    return {
        name: sensor.observe
        for name, sensor in model.sensors.items()
        if isinstance(sensor.observe, int) and not sensor.filtered
    }


def primary_channel(model: Model) -> str:
    """Return the channel that shows the lowest component of the state that is measured,
    or else the first channel.
    """
    measured = measured_components(model)
    return min(measured or model.sensors, key=lambda name: measured.get(name, 0))


def state_channels(model: Model) -> dict[str, int | Callable[[Array], Array]]:
    """Return the channels that depend on the state alone, and how."""
    return {
        name: sensor.observe
        for name, sensor in model.sensors.items()
        if not isinstance(sensor.observe, Output)
    }


def augmented_field(model: Model, system, t, state):
    """Return the rate of change of the system state and of the sensor filters."""
    lags = filtered_channels(model)
    size = state.shape[0] - len(lags)
    x = state[:size]
    rates = [system.vector_field(t, x)]
    for place, name in enumerate(lags):
        sensor = model.sensors[name]
        corner = 2 * jnp.pi * sensor.bandwidth_hz
        rates.append((corner * (sensor.seen(system, t, x) - state[size + place]))[None])
    return jnp.concatenate(rates)
