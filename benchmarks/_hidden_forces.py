"""Forces without a name, in the units of `_hidden_physics.py`."""

import numpy as np

from benchmarks._hidden_physics import direction, force
from benchmarks._optional_numba import register_jitable


@register_jitable
def _within(x, low, high):
    return 1.0 * ((x > low) & (x < high))


def _spring_and_damper(own, u, rate, hertz):
    """A damper in series with a spring, whose force relaxes."""
    return (rate - own[0] * 1.5 * hertz,)


def _hysteresis(own, u, rate, hertz):
    """A Bouc-Wen law that yields within a quarter of the range."""
    z = own[0]
    return (4 * rate - 2 * (abs(rate) * z * abs(z) + rate * z * z),)


_AT_PLACE, _AT_SPEED, _ON_THE_WAY = (
    ("position",),
    ("velocity",),
    ("position", "velocity"),
)

FORCES = {
    # forces as a function of position
    "stop": force(_AT_PLACE, lambda u, w, phi, t, s: -np.maximum(u - 0.6, 0), 0.2, 0.6),
    "hardening_side": force(
        _AT_PLACE, lambda u, w, phi, t, s: np.maximum(-u - 0.2, 0) ** 2, 0.15, 0.4
    ),
    "magnet": force(
        _AT_PLACE,
        lambda u, w, phi, t, s: np.exp(-(((u - 0.3) / 0.2) ** 2)),
        0.03,
        0.1,
    ),
    "detent": force(
        _AT_PLACE,
        lambda u, w, phi, t, s: (0.2 - u) * np.exp(-0.5 * ((u - 0.2) / 0.15) ** 2),
        0.3,
        0.9,
    ),
    "detents": force(
        _AT_PLACE, lambda u, w, phi, t, s: np.sin(2 * np.pi * 1.8 * u), 0.03, 0.1
    ),
    "backlash": force(
        _AT_PLACE,
        lambda u, w, phi, t, s: np.minimum(np.maximum(u, -0.3), 0.3) - u,
        0.15,
        0.5,
    ),
    "double_well": force(_AT_PLACE, lambda u, w, phi, t, s: u - 2.2 * u**3, 0.06, 0.2),
    "two_wells": force(
        _AT_PLACE,
        lambda u, w, phi, t, s: (
            np.exp(-(((u - 0.45) / 0.12) ** 2))
            - 0.7 * np.exp(-(((u + 0.3) / 0.15) ** 2))
        ),
        0.04,
        0.12,
    ),
    "shelf": force(
        _AT_PLACE, lambda u, w, phi, t, s: -np.tanh((u - 0.1) / 0.15), 0.03, 0.1
    ),
    # of velocity
    "fast_drag": force(
        _AT_SPEED,
        lambda u, w, phi, t, s: -np.sign(w) * np.maximum(np.abs(w) - 0.4, 0),
        0.08,
        0.25,
    ),
    "stick_slip": force(
        _AT_SPEED,
        lambda u, w, phi, t, s: -direction(w) * np.exp(-((w / 0.15) ** 2)),
        0.02,
        0.06,
    ),
    "one_way": force(_AT_SPEED, lambda u, w, phi, t, s: -1.0 * (w > 0), 0.02, 0.06),
    "cubic_drag": force(_AT_SPEED, lambda u, w, phi, t, s: -(w**3), 0.08, 0.25),
    "root_drag": force(
        _AT_SPEED,
        lambda u, w, phi, t, s: -np.sign(w) * np.sqrt(np.abs(w)),
        0.03,
        0.1,
    ),
    "one_way_fast": force(
        _AT_SPEED, lambda u, w, phi, t, s: -(np.maximum(w - 0.3, 0) ** 2), 0.1, 0.4
    ),
    # of position and velocity
    "zone_friction": force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -np.sign(w) * _within(u, -0.1, 0.5),
        0.01,
        0.03,
    ),
    "rough_end": force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -w * np.maximum(u, 0) ** 2,
        0.05,
        0.2,
    ),
    "eddy_brake": force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -w * np.exp(-(((u + 0.2) / 0.25) ** 2)),
        0.05,
        0.15,
    ),
    "fat_friction": force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -direction(w) * u**2, 0.02, 0.06
    ),
    "centrifugal": force(_ON_THE_WAY, lambda u, w, phi, t, s: u * w**2, 0.1, 0.3),
    "lever": force(_ON_THE_WAY, lambda u, w, phi, t, s: -u * w, 0.05, 0.15),
    # products of two functions of one argument
    "zone_damper": force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -w * _within(u, 0.1, 0.6), 0.05, 0.15
    ),
    "zone_cubic": force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -(w**3) * _within(u, -0.2, 0.5), 0.1, 0.3
    ),
    "softening": force(
        _ON_THE_WAY, lambda u, w, phi, t, s: u * np.exp(-((w / 0.4) ** 2)), 0.04, 0.12
    ),
    "pulled_end": force(
        ("phase", "position"),
        lambda u, w, phi, t, s: np.cos(phi - 1.0) * (u > 0.2),
        0.04,
        0.12,
    ),
    # other functions of two arguments
    "moving_stop": force(
        ("phase", "position"),
        lambda u, w, phi, t, s: -np.maximum(u - 0.4 + 0.2 * np.cos(phi), 0),
        0.2,
        0.5,
    ),
    "moving_belt": force(
        ("phase", "velocity"),
        lambda u, w, phi, t, s: -np.tanh((w - 0.4 * np.cos(phi)) / 0.05),
        0.02,
        0.06,
    ),
    "travelling_wave": force(
        ("phase", "position"), lambda u, w, phi, t, s: np.cos(phi - 4 * u), 0.02, 0.06
    ),
    "lossy_stop": force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -(np.maximum(u - 0.4, 0) ** 1.5) * (1 + 0.8 * w),
        0.3,
        0.8,
    ),
    "late_spring": force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -np.maximum(u + 0.3 * w - 0.3, 0), 0.2, 0.5
    ),
    # of the drive angle
    "pulse": force(
        ("phase",), lambda u, w, phi, t, s: 1.0 * (np.cos(phi - 2.0) > 0.6), 0.02, 0.06
    ),
    "parametric": force(
        ("phase", "position"),
        lambda u, w, phi, t, s: u * np.cos(2 * phi - 1.0),
        0.03,
        0.1,
    ),
    "ratchet": force(
        ("phase",),
        lambda u, w, phi, t, s: np.cos(2 * phi) + 0.5 * np.sin(3 * phi),
        0.02,
        0.06,
    ),
    "pumping": force(
        ("phase", "velocity"),
        lambda u, w, phi, t, s: -w * np.cos(phi - 0.5),
        0.05,
        0.15,
    ),
    "lobes": force(
        ("phase",),
        lambda u, w, phi, t, s: (
            np.exp(3 * (np.cos(phi - 4) - 1))
            - 0.6 * np.exp(6 * (np.cos(phi - 1.2) - 1))
        ),
        0.02,
        0.06,
    ),
    "grip": force(
        ("phase", "velocity"),
        lambda u, w, phi, t, s: -direction(w) * (np.cos(phi - 2) > 0.2),
        0.02,
        0.06,
    ),
    # of time
    "ramp": force(("time",), lambda u, w, phi, t, s: t, 0.02, 0.06),
    "jolt": force(("time",), lambda u, w, phi, t, s: 1.0 * (t > 0.55), 0.02, 0.06),
    "warming": force(("time", "velocity"), lambda u, w, phi, t, s: w * t, 0.02, 0.06),
    "fading": force(("time",), lambda u, w, phi, t, s: np.exp(-5 * t), 0.02, 0.06),
    "seizing": force(
        ("time", "velocity"),
        lambda u, w, phi, t, s: -np.sign(w) * t,
        0.01,
        0.03,
    ),
    "burst": force(
        ("time",), lambda u, w, phi, t, s: _within(t, 0.3, 0.45), 0.03, 0.08
    ),
    "stiff_later": force(
        ("time", "position"), lambda u, w, phi, t, s: -u * (t > 0.5), 0.05, 0.15
    ),
    "settling": force(
        ("time", "position"), lambda u, w, phi, t, s: -u * np.exp(-4 * t), 0.05, 0.15
    ),
    "leak": force(
        ("time", "velocity"), lambda u, w, phi, t, s: w * (t > 0.6), 0.05, 0.15
    ),
    # with memory
    "relaxing": force(
        ("memory",),
        lambda u, w, phi, t, own: -own,
        0.1,
        0.3,
        memory=_spring_and_damper,
        states=1,
    ),
    "hysteresis": force(
        ("memory",),
        lambda u, w, phi, t, own: -own,
        0.02,
        0.06,
        memory=_hysteresis,
        states=1,
    ),
}
