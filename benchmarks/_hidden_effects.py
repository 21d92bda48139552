"""Effects without a name, in the units of `_hidden_physics.py`."""

import numpy as np

from benchmarks._hidden_forces import FORCES
from benchmarks._hidden_physics import Effect


def _resonance(own, u, rate, hertz):
    """A lightly damped oscillator at 3.7 times the drive frequency, driven by the
    deflection.
    """
    w = 2 * np.pi * 3.7 * hertz
    return (own[1], w * w * (u - own[0]) - 0.08 * w * own[1])


EFFECTS = {
    **FORCES,
    "surge": Effect(
        "resonance",
        ("frequency",),
        lambda u, w, phi, t, own: own,
        (0.02, 0.06),
        _resonance,
        2,
    ),
    # at impacts
    "soft_above": Effect(
        "restitution",
        ("speed",),
        lambda u, w, phi, t, s: -1.0 * (s > 0.55),
        (0.05, 0.15),
    ),
    "soft_band": Effect(
        "restitution",
        ("speed",),
        lambda u, w, phi, t, s: -np.exp(-(((s - 0.45) / 0.12) ** 2)),
        (0.05, 0.15),
    ),
    "wear": Effect(
        "restitution", ("time",), lambda u, w, phi, t, s: -(t**2), (0.05, 0.15)
    ),
    "soft_side": Effect(
        "restitution",
        ("phase",),
        lambda u, w, phi, t, s: -np.cos(phi - 1.0),
        (0.04, 0.12),
    ),
    "crack": Effect(
        "restitution", ("time",), lambda u, w, phi, t, s: -1.0 * (t > 0.5), (0.05, 0.15)
    ),
    "expo_rest": Effect(
        "restitution",
        ("speed",),
        lambda u, w, phi, t, s: -np.exp(-s / 0.25),
        (0.05, 0.15),
    ),
    "soft_arc": Effect(
        "restitution",
        ("phase",),
        lambda u, w, phi, t, s: -1.0 * (np.cos(phi - 3.0) > 0.3),
        (0.05, 0.15),
    ),
    "soft_slow": Effect(
        "restitution", ("speed",), lambda u, w, phi, t, s: -((1 - s) ** 3), (0.05, 0.2)
    ),
    # at the surface
    "thermal": Effect(
        "surface", ("time",), lambda u, w, phi, t, s: 1 - np.exp(-3 * t), (8.0, 25.0)
    ),
    "dent": Effect(
        "surface",
        ("phase",),
        lambda u, w, phi, t, s: -np.exp(12 * (np.cos(phi - 2.5) - 1)),
        (5.0, 20.0),
    ),
    "shifted_wall": Effect(
        "surface", ("time",), lambda u, w, phi, t, s: 1.0 * (t > 0.5), (8.0, 25.0)
    ),
    "breathing": Effect(
        "surface", ("time",), lambda u, w, phi, t, s: np.sin(5 * t), (8.0, 25.0)
    ),
    # in the sensor
    "off_centre": Effect(
        "sensor",
        ("position",),
        lambda u, w, phi, t, s: np.sin(2 * np.pi * 0.8 * u + 0.4),
        (3.0, 10.0),
    ),
    "bent_scale": Effect(
        "sensor", ("position",), lambda u, w, phi, t, s: u**2, (4.0, 12.0)
    ),
    "nick": Effect(
        "sensor",
        ("position",),
        lambda u, w, phi, t, s: np.exp(-(((u - 0.1) / 0.15) ** 2)),
        (4.0, 12.0),
    ),
    "fast_sensor": Effect(
        "sensor", ("velocity",), lambda u, w, phi, t, s: w**2, (4.0, 12.0)
    ),
    "drift": Effect(
        "sensor", ("time",), lambda u, w, phi, t, s: np.sin(2.2 * t), (6.0, 20.0)
    ),
    "slipped": Effect(
        "sensor", ("time",), lambda u, w, phi, t, s: 1.0 * (t > 0.4), (3.0, 10.0)
    ),
    "pickup": Effect(
        "sensor", ("phase",), lambda u, w, phi, t, s: np.cos(phi - 1.0), (2.0, 8.0)
    ),
}
