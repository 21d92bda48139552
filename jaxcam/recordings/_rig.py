"""The content of a rig file: nominal parameters, tolerances and sensors."""

import dataclasses
import difflib
import math

import equinox as eqx
import jax
import jax.numpy as jnp

from ..models import CamFollower, ConstantRestitution, EccentricCircle
from ._errors import RigError


# Speed (rad/s) that 19 of 20 velocities of the thesis cam-follower do not exceed
_FAST = 2.0


@dataclasses.dataclass(frozen=True)
class Quantity:
    """A nominal value and its tolerance, in SI units."""

    value: float
    """Nominal value."""
    tolerance: float = 0.0
    """Largest deviation of the actual value."""

    @property
    def array(self) -> jax.Array:
        """The nominal value as a parameter of a model."""
        return jnp.asarray(self.value, dtype=float)


@dataclasses.dataclass(frozen=True)
class Gyro:
    """A rate gyro: first-order bandwidth (Hz), range and noise (rad/s)."""

    bandwidth_hz: float
    """First-order bandwidth (Hz)."""
    range_rad_s: float
    """Largest measurable rate (rad/s)."""
    noise_rad_s: float
    """Standard deviation of the noise (rad/s)."""


@dataclasses.dataclass(frozen=True)
class Sensors:
    """Sampling rate (Hz), counts per turn and noise (rad) of the two encoders."""

    sample_rate: float
    """Sampling rate (Hz)."""
    cam_counts_per_turn: int
    """Counts per turn of the cam encoder."""
    follower_counts_per_turn: int
    """Counts per turn of the follower encoder."""
    cam_noise: float
    """Standard deviation of the noise of the cam angle (rad)."""
    follower_noise: float
    """Standard deviation of the noise of the follower angle (rad)."""
    gyro: Gyro | None = None
    """The rate gyro, if there is one."""

    @property
    def follower_floor(self) -> float:
        """Standard deviation of the follower angle (rad), from noise and
        quantisation.
        """
        return _floor(self.follower_noise, self.follower_counts_per_turn)

    @property
    def cam_floor(self) -> float:
        """Standard deviation of the cam angle (rad), from noise and quantisation."""
        return _floor(self.cam_noise, self.cam_counts_per_turn)


@dataclasses.dataclass(frozen=True)
class References:
    """Constants in the functional forms of missing-physics terms.

    They define the meaning of each strength and are not fitted; the defaults are those
    of the thesis cam-follower.

    Examples:
        >>> from jaxcam.recordings import References
        >>> References().stribeck_speed
        0.1
    """

    spring_center: float = 0.27
    """Angle (rad) about which a nonlinear spring is symmetric."""
    impact_speed: float = 0.3
    """Reference speed (rad/s) of a coefficient of restitution that decreases with the
    approach speed.
    """
    profile_lead: float = 0.7
    """Phase (rad) of an error of the cam profile with two periods per revolution."""
    stribeck_speed: float = 0.1
    """Stribeck speed (rad/s), below which friction is larger."""
    slip_speed: float = 0.015
    """Width (rad/s) of the `tanh` that smooths dry friction at zero velocity, far below
    the speeds of the motion; for friction that varies with position, `free_slip_speed`
    is used instead.
    """
    free_slip_speed: float = 0.01
    """Slip speed (rad/s) of friction that varies with position."""

    @classmethod
    def of_speed(cls, fast: float) -> "References":
        """Return the constants for a motion whose highest speeds are about `fast`.

        Each reference speed has the same ratio to the speeds of the motion as for the
        thesis rig.
        """
        share, usual = fast / _FAST, cls()
        return cls(
            spring_center=0.0,
            impact_speed=share * usual.impact_speed,
            stribeck_speed=share * usual.stribeck_speed,
            slip_speed=share * usual.slip_speed,
            free_slip_speed=share * usual.free_slip_speed,
        )

    def sharper(self, share: float) -> "References":
        """Return the constants with the slip speeds multiplied by `share`."""
        return dataclasses.replace(
            self,
            slip_speed=share * self.slip_speed,
            free_slip_speed=share * self.free_slip_speed,
        )


@dataclasses.dataclass(frozen=True)
class Rig:
    """The checked content of `rig.toml`; `system` creates a model from it.

    Lengths are in m, the inertia in kg m^2 and the stiffness in N/m. Only the ratio of
    stiffness to inertia can be identified from a recording.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.recordings import read_rig
        >>> float(read_rig(DEMO_RIG / "rig.toml").system(15.0).speed)
        15.0
    """

    cam_radius: Quantity
    """Radius of the cam (m)."""
    cam_eccentricity: Quantity
    """Eccentricity of the cam (m)."""
    cam_center_x: Quantity
    """x-coordinate of the cam axis relative to the hinge (m)."""
    cam_center_y: Quantity
    """y-coordinate of the cam axis relative to the hinge (m)."""
    follower_half_height: Quantity
    """Distance of the follower face from the hinge (m)."""
    cam_rotation: str
    """"clockwise" or "counterclockwise"."""
    inertia: Quantity
    """Moment of inertia of the follower (kg m^2)."""
    spring_stiffness: Quantity
    """Stiffness of the spring (N/m)."""
    spring_hook_x: Quantity
    """x-coordinate of the spring's suspension point (m)."""
    spring_elongation: Quantity
    """Length from which the elongation of the spring is measured (m)."""
    restitution: Quantity
    """Coefficient of restitution."""
    sensors: Sensors
    """Sensors of the rig."""
    references: References = References()
    """Constants of the missing-physics terms."""

    def replace(self, **values: float) -> "Rig":
        """Return the rig with other nominal values and unchanged tolerances.

        Raises:
            RigError: A name is not a quantity of the rig.
        """
        changes = {}
        for name, value in values.items():
            before = getattr(self, name, None)
            if not isinstance(before, Quantity):
                raise RigError(f"A rig has no quantity `{name}`{_meant(name, self)}.")
            changes[name] = dataclasses.replace(before, value=float(value))
        return dataclasses.replace(self, **changes)

    def profile(self) -> EccentricCircle:
        """Return the nominal cam."""
        return EccentricCircle(
            radius=self.cam_radius.array,
            eccentricity=self.cam_eccentricity.array,
            center_x=self.cam_center_x.array,
            center_y=self.cam_center_y.array,
            half_height=self.follower_half_height.array,
        )

    def system(
        self,
        speed: float,
        phase: float = 0.0,
        *,
        restitution: eqx.Module | None = None,
    ) -> CamFollower:
        """Return the nominal model, a `CamFollower` with its cam turning at `speed`
        (rad/s).

        Args:
            speed: Speed of the cam (rad/s).
            phase: Angle of the cam at time zero (rad).
            restitution: Restitution law to use instead of the rig's constant
                coefficient.
        """
        if restitution is None:
            restitution = ConstantRestitution(self.restitution.array)
        return CamFollower(
            speed=jnp.asarray(speed, dtype=float),
            phase=jnp.asarray(phase, dtype=float),
            inertia=self.inertia.array,
            stiffness=self.spring_stiffness.array,
            spring_hook_x=self.spring_hook_x.array,
            spring_elongation=self.spring_elongation.array,
            spring_half_height=self.follower_half_height.array,
            profile=self.profile(),
            restitution=restitution,
            rotation=self.cam_rotation,
        )


def _meant(name: str, rig: Rig) -> str:
    names = [field.name for field in dataclasses.fields(rig)]
    found = difflib.get_close_matches(name, names, n=1)
    return f"; is `{found[0]}` meant?" if found else "; see `Rig` for the names"


def _floor(noise: float, counts: int) -> float:
    step = 2 * math.pi / counts
    # a rounded number has a uniform error of variance step^2 / 12
    return math.sqrt(noise**2 + step**2 / 12)
