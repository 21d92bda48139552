"""Simulate recordings of a known system, for example to plan an experiment."""

from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..hybrid import HybridSystem, simulate, SwitchedSystem, Wrapping
from ..hybrid.surface import field_in_force, gaps
from ._errors import RecordingError
from ._recording import Recording


# Number of filter steps per sample; it is large because impacts occur between samples
_FINER = 256


class Wandering(Wrapping):
    """A driven system whose drive speed drifts slowly, as in real drives.

    The drive turns at `speed (1 + depth w)` with w = 0.7 cos(2 pi 0.31 t) + 0.3 cos(2
    pi 0.87 t): two slow harmonics with incommensurate frequencies.

    Examples:
        >>> from jaxcam.models import preset
        >>> from jaxcam.recordings import Wandering
        >>> Wandering(preset("calibrated")).state_names
        ('follower angle', 'follower velocity')
    """

    base: HybridSystem
    """The system."""
    depth: float = 2e-4
    """Relative amplitude of the speed drift."""
    speed: Callable[[Any], Array] = eqx.field(
        default=lambda system: system.speed, static=True
    )
    """Selects the speed field of `base`."""
    phase: Callable[[Any], Array] = eqx.field(
        default=lambda system: system.phase, static=True
    )
    """Selects the phase field of `base`."""

    def __check_init__(self):
        if isinstance(self.base, SwitchedSystem):
            raise ValueError(
                "Wandering does not support switching surfaces; record the system with "
                "a constant drive speed."
            )

    @property
    def inner(self) -> HybridSystem:
        return self.base

    def angle(self, t) -> Array:
        """Return the angle of the drive (rad) at `t` (s), elementwise."""
        wander = 0.0
        for share, frequency in _TONES:
            w = 2 * jnp.pi * frequency
            wander = wander + share * jnp.sin(w * t) / w
        return self.phase(self.base) + self.speed(self.base) * (t + self.depth * wander)

    def at(self, t) -> HybridSystem:
        """Return the base system with a drive of constant speed that has, at `t`, the
        same angle and speed as the drifting one.
        """
        angle, rate = jax.jvp(self.angle, (t,), (jnp.ones_like(t),))
        here = rate, angle - rate * t
        return eqx.tree_at(lambda s: (self.speed(s), self.phase(s)), self.base, here)

    def vector_field(self, t, state):
        return self.at(t).vector_field(t, state)

    def gap(self, t, state):
        # shifting the phase is enough: only the angle matters here, and its rate of
        # change, obtained by differentiation, is also correct
        phase = self.angle(t) - self.speed(self.base) * t
        base = eqx.tree_at(lambda s: self.phase(s), self.base, phase)
        return base.gap(t, state)

    def impact(self, t, state):
        return self.at(t).impact(t, state)


_TONES = ((0.7, 0.31), (0.3, 0.87))


def record(
    system: HybridSystem,
    sensors: Mapping[str, Any],
    duration: float,
    *,
    rng: np.random.Generator,
    state=None,
    settle: float = 0.0,
    interval: float = 5e-4,
    drive: tuple[float, float] | None = None,
    drive_channel: str = "cam_angle_rad",
    name: str = "synthetic",
) -> Recording:
    """Simulate a system and record it with sensors.

    Args:
        system: The system; to simulate drift of the drive speed, wrap it in
            `jaxcam.recordings.Wandering`.
        sensors: A `jaxcam.fitting.Sensor` for each channel.
        duration: Length of the recording (s).
        rng: Random number generator for the noise.
        state: Initial state, `(n,)`; `None` for the release point.
        settle: Time simulated before the recording begins (s).
        interval: Time between samples (s).
        drive: Noise and resolution (rad) of an encoder on the drive of a `Wandering`,
            recorded as `drive_channel`.
        drive_channel: Name of that channel.
        name: Name of the recording.

    Returns:
        A [`jaxcam.recordings.Recording`][]. An accelerometer shows the contact forces,
            but not the shocks of impacts.

    Raises:
        RecordingError: The simulation stopped early.

    Examples:
        >>> from jaxcam.fitting import Sensor
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import record
        >>> rng, sensors = np.random.default_rng(0), {"height_m": Sensor(0, noise=1e-3)}
        >>> record(BouncingBall(), sensors, 0.5, rng=rng, state=[1.0, 0.0]).name
        'synthetic'
    """
    trajectory = simulate(system, state, 0.0, settle + duration, max_steps=1 << 17)
    if not bool(trajectory.successful):
        raise RecordingError(f"{name}: the simulation failed: {trajectory.result}")
    count = round(duration / interval)
    time = interval * np.arange(count)
    channels = {
        channel: _sense(sensor, system, trajectory, settle, count, interval, rng)
        for channel, sensor in sensors.items()
    }
    speed = None
    if isinstance(system, Wandering):
        speed = float(system.speed(system.base))
        if drive is not None:
            angle = np.asarray(system.angle(jnp.asarray(settle + time)))
            angle = angle - 2 * np.pi * np.floor(angle[0] / (2 * np.pi))
            noisy = angle + drive[0] * rng.standard_normal(count)
            channels = {drive_channel: _round(noisy, drive[1]), **channels}
    return Recording(name, time, channels, speed)


def _sense(
    sensor, system, trajectory, settle, count, interval, rng
) -> Float[np.ndarray, " k"]:
    filtered = sensor.bandwidth_hz != float("inf")
    finer = _FINER if filtered else 1
    fine = interval / finer
    times = settle + fine * np.arange(count * finer) - float(sensor.lag)
    states = np.asarray(trajectory.at(np.maximum(times, trajectory.t0)))
    held = _in_contact(trajectory, times)

    def read(t, state, held):
        return sensor.seen(_Held(system, held), t, state)

    seen = jax.vmap(read)(jnp.asarray(times), jnp.asarray(states), jnp.asarray(held))
    seen = np.asarray(seen)
    if filtered:
        seen = _filtered(seen, 2 * np.pi * sensor.bandwidth_hz * fine)
    seen = float(sensor.offset) + float(sensor.gain) * seen[::finer]
    noisy = seen + float(sensor.noise) * rng.standard_normal(count)
    return np.clip(_round(noisy, sensor.resolution), -sensor.limit, sensor.limit)


class _Held(Wrapping):
    """A system whose vector field contains the contact forces."""

    system: HybridSystem
    contact: Bool[Array, " m"]

    @property
    def inner(self) -> HybridSystem:
        return self.system

    def vector_field(self, t, state):
        return field_in_force(self.system, t, state, self.contact)

    def gap(self, t, state):
        return self.system.gap(t, state)

    def impact(self, t, state):
        return self.system.impact(t, state)


def _in_contact(trajectory, times) -> Bool[np.ndarray, "k m"]:
    """Return for each time whether each constraint is in contact."""
    number = gaps(trajectory.system, trajectory.t0, trajectory.final).shape[0]
    found = np.zeros((len(times), number), dtype=bool)
    contacts = trajectory.contacts
    for row in range(int(contacts.count)):
        inside = (times >= contacts.start[row]) & (times < contacts.end[row])
        found[inside, int(contacts.constraint[row])] = True
    return found


def _filtered(samples, step: float) -> np.ndarray:
    """Apply a first-order filter to a signal that is linear between its samples."""
    from scipy.signal import lfilter

    keep = np.exp(-step)
    late = (1 - keep) / step
    b = [1 - late, late - keep]
    first = samples[0] * (1 - b[0])
    return lfilter(b, [1, -keep], samples, zi=[first])[0]


def _round(samples, step: float) -> np.ndarray:
    return np.round(samples / step) * step if step else samples
