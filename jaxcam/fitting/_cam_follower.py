"""The cam-follower as a fitting problem: parameters, tolerances and sensors."""

import math
from collections.abc import Sequence

from ..recordings import Rig
from .engine import cam_follower_drive, Model, Parameter, Sensor


def cam_follower_model(
    rig: Rig, channels: Sequence[str] = ("follower_angle_rad",)
) -> Model:
    """Return the nominal model with its sensors and a drive that follows the cam
    encoder.

    Args:
        rig: The rig.
        channels: Channels to fit: `follower_angle_rad`, `gyro_rad_s` or both.

    Returns:
        A [`jaxcam.fitting.Model`][].

    Raises:
        ValueError: A channel is unknown, or the rig has no gyro.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.fitting import cam_follower_model
        >>> from jaxcam.recordings import read_rig
        >>> list(cam_follower_model(read_rig(DEMO_RIG / "rig.toml")).sensors)
        ['follower_angle_rad']
    """
    known = rig_sensors(rig)
    for channel in channels:
        if channel not in known:
            raise ValueError(
                f"The rig has no sensor for `{channel}`; it has {', '.join(known)}."
            )
    system = rig.system(1.0)
    return Model(system, {c: known[c] for c in channels}, cam_follower_drive())


def rig_sensors(rig: Rig) -> dict[str, Sensor]:
    """Return the sensors of the follower as specified in the rig file.

    Args:
        rig: The rig.

    Returns:
        Sensors by channel.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.fitting import rig_sensors
        >>> from jaxcam.recordings import read_rig
        >>> "follower_angle_rad" in rig_sensors(read_rig(DEMO_RIG / "rig.toml"))
        True
    """
    sensors = rig.sensors
    found = {
        "follower_angle_rad": Sensor(
            0,
            noise=sensors.follower_noise,
            resolution=2 * math.pi / sensors.follower_counts_per_turn,
        )
    }
    if sensors.gyro is not None:
        gyro = sensors.gyro
        found["gyro_rad_s"] = Sensor(
            1,
            noise=gyro.noise_rad_s,
            limit=gyro.range_rad_s,
            bandwidth_hz=gyro.bandwidth_hz,
        )
    return found


def cam_follower_parameters(rig: Rig, base=lambda system: system) -> list[Parameter]:
    """Return the identifiable parameters of the rig: stiffness K (as its ratio K/J to
    the inertia J), spring, cam and restitution.

    The inertia is held fixed because only K/J affects the motion. The half height of
    the follower in the cam profile is also fixed, because only its sum with the cam
    radius matters.

    Args:
        rig: The rig.
        base: Selects the `CamFollower` in a system that wraps it.

    Returns:
        A list of [`jaxcam.fitting.Parameter`][].

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.fitting import cam_follower_parameters
        >>> from jaxcam.recordings import read_rig
        >>> cam_follower_parameters(read_rig(DEMO_RIG / "rig.toml"))[0].name
        'stiffness'
    """
    half = rig.follower_half_height.tolerance
    table = (
        ("stiffness", lambda s: s.stiffness, rig.spring_stiffness.tolerance, "N/m"),
        ("spring_hook_x", lambda s: s.spring_hook_x, rig.spring_hook_x.tolerance, "m"),
        (
            "spring_elongation",
            lambda s: s.spring_elongation,
            rig.spring_elongation.tolerance,
            "m",
        ),
        ("spring_half_height", lambda s: s.spring_half_height, half, "m"),
        (
            "cam_radius",
            lambda s: s.profile.radius,
            math.hypot(rig.cam_radius.tolerance, half),
            "m",
        ),
        (
            "cam_eccentricity",
            lambda s: s.profile.eccentricity,
            rig.cam_eccentricity.tolerance,
            "m",
        ),
        ("cam_center_x", lambda s: s.profile.center_x, rig.cam_center_x.tolerance, "m"),
        ("cam_center_y", lambda s: s.profile.center_y, rig.cam_center_y.tolerance, "m"),
        ("restitution", lambda s: s.restitution.r, rig.restitution.tolerance, ""),
    )
    return [
        Parameter(
            name,
            lambda m, where=where: where(base(m.system)),
            tolerance=tolerance,
            lower=0.0 if name == "restitution" else -math.inf,
            upper=1.0 if name == "restitution" else math.inf,
            unit=unit,
        )
        for name, where, tolerance, unit in table
        # a quantity without tolerance is held fixed
        if tolerance > 0
    ]
