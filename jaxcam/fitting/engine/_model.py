"""The model to fit: a system, its drive, and its sensors."""

from collections.abc import Callable, Mapping

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...hybrid import HybridSystem


def _array(value) -> Array:
    return jnp.asarray(value, dtype=float)


def _number(default: float):
    return eqx.field(default=default, converter=_array)


class Sensor(eqx.Module):
    """A sensor: the map from the state x(t) to one channel of a recording.

    The sensor sees `offset + gain * observe(x(t - lag))`, through a first-order filter
    where it has a bandwidth, with white noise, rounded to its resolution and cut off
    at its limit. The likelihood is that of such samples: a rounded one says in which
    interval it was, a saturated one only that it was beyond the limit.

    Args:
        observe: A component of the state, or a function of the state.
        noise: Standard deviation of the noise, in the units of the channel.
        resolution: Smallest step of the channel; zero for a continuous one.
        limit: Largest magnitude that it can show.
        bandwidth_hz: Of a first-order filter (Hz); infinite for none.
        gain: A parameter that can be fitted like those of the system.
        offset: Another one, in the units of the channel.
        lag: Another one (s); it must be short compared with the time in which the
            motion changes.
        tails: Degrees of freedom of a Student distribution for noise with outliers;
            infinite for a Gaussian one.
        error: What else the sensor shows in a fit, `error(system, t, value, slope)` of
            the value and its rate of change; nothing by default.
    """

    observe: int | Callable[[Array], Array] = eqx.field(static=True)
    noise: Float[Array, ""] = eqx.field(converter=_array)
    resolution: float = eqx.field(default=0.0, static=True)
    limit: float = eqx.field(default=float("inf"), static=True)
    bandwidth_hz: float = eqx.field(default=float("inf"), static=True)
    tails: float = eqx.field(default=float("inf"), static=True)
    gain: Float[Array, ""] = _number(1.0)
    offset: Float[Array, ""] = _number(0.0)
    lag: Float[Array, ""] = _number(0.0)
    error: Callable | None = eqx.field(default=None, static=True)

    def __check_init__(self):
        if not self.noise > 0:
            raise ValueError(f"Give a sensor a positive `noise`; it is {self.noise}.")
        if not self.bandwidth_hz > 0:
            raise ValueError(
                f"Give a sensor a positive `bandwidth_hz`; it is {self.bandwidth_hz}."
            )

    @property
    def floor(self) -> Float[Array, ""]:
        """Standard deviation of noise and rounding together."""
        return jnp.sqrt(self.noise**2 + self.resolution**2 / 12)

    @property
    def filtered(self) -> bool:
        return self.bandwidth_hz != float("inf")

    def seen(self, state: Float[Array, " n"]) -> Array:
        """Return the measured quantity of a state, before gain and offset."""
        if isinstance(self.observe, int):
            return state[self.observe]
        return jnp.asarray(self.observe(state))


class Turning(eqx.Module):
    """A drive that was measured: where a system keeps its speed and its phase.

    While a recording is predicted, the speed follows the measured one and the phase is
    such that the drive is where it was measured. `phase` of the fitted system is then
    an offset between its angle and the encoder's.

    **Arguments:** functions that pick both out of the system, such as
    `lambda s: s.speed` and, where the system is a field of another,
    `lambda s: s.base.speed`.
    """

    speed: Callable[[HybridSystem], Array] = eqx.field(static=True)
    phase: Callable[[HybridSystem], Array] = eqx.field(static=True)

    def at(self, system, t, angle, rate):
        """The system with its drive at `angle` and turning at `rate` at time `t`."""
        phase = self.phase(system) + angle - rate * t
        return eqx.tree_at(
            lambda s: (self.speed(s), self.phase(s)), system, (rate, phase)
        )


class Input(eqx.Module):
    """An input that was measured, as a force or a voltage: where a system keeps it.

    While a recording is predicted, the system has the value that its own recording had,
    each sample held until the next one, as digital controllers do; over a step of the
    integration, its mean.
    """

    channel: str = eqx.field(static=True)
    """Of the recordings."""
    value: Callable[[HybridSystem], Array] = eqx.field(static=True)
    """Picks the field out of the system, such as `lambda s: s.force`."""

    def at(self, system, t, level, rate):
        """The system with its input at `level`."""
        del t, rate
        return eqx.tree_at(self.value, system, level)


class Model(eqx.Module):
    """A system and the sensors that see it; what parameters are picked from."""

    system: HybridSystem
    """Any `HybridSystem`."""
    sensors: Mapping[str, Sensor]
    """A `Sensor` for each channel that is fitted."""
    drive: Turning | Input | None = None
    """For a system that is turned by a measured drive, or that has a measured input."""

    def driven(self, t, angle, rate) -> HybridSystem:
        """The system as it is near time `t`."""
        if self.drive is None:
            return self.system
        return self.drive.at(self.system, t, angle, rate)


def cam_follower_drive() -> Turning:
    """The drive of a `CamFollower`."""
    return _CAM_DRIVE


def _speed(system):
    return system.speed


def _phase(system):
    return system.phase


# one object, so that models of the same kind share compiled programs
_CAM_DRIVE = Turning(_speed, _phase)


def filtered_channels(model: Model) -> tuple[str, ...]:
    """Channels whose sensor has a bandwidth and so a state of its own."""
    return tuple(name for name in model.sensors if model.sensors[name].filtered)


def augmented_field(model: Model, system, t, state):
    """Rate of change of the system's state and of the sensors' filters."""
    lags = filtered_channels(model)
    size = state.shape[0] - len(lags)
    x = state[:size]
    rates = [system.vector_field(t, x)]
    for place, name in enumerate(lags):
        sensor = model.sensors[name]
        corner = 2 * jnp.pi * sensor.bandwidth_hz
        rates.append((corner * (sensor.seen(x) - state[size + place]))[None])
    return jnp.concatenate(rates)
