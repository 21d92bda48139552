"""Unnamed physics for the rigs of `_own_rig_makers.py`.

Each effect is scaled to the motion of the rig without it: `u` is the first coordinate,
from -1 to 1 over its range, `w` its velocity divided by its largest value, `phi` the
drive angle, `t` the elapsed fraction of the record, and `s` the approach speed divided
by its largest value.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from benchmarks._optional_numba import register_jitable


class Effect(NamedTuple):
    """An effect that a textbook model lacks.

    - `kind` and `arguments`, as in a verdict.
    - `value(u, w, phi, t, s)`: for a force, in units of the rig's own acceleration; for
        a coefficient of restitution, the logarithm of its factor; for a surface or a
        sensor, in units of the sensor noise.
    - `size`: smallest and largest factor applied to `value`.
    - `memory`: rates of change of the effect's own `states` as a function of `(own, u,
        rate, hertz)`, with the `rate` of change of `u` and the drive frequency `hertz`.
        The `value` of such an effect takes the first of its states in place of `s`.
    """

    kind: str
    arguments: tuple[str, ...]
    value: Callable
    size: tuple[float, float]
    memory: Callable | None = None
    states: int = 0


@register_jitable
def _within(x, low, high):
    return 1.0 * ((x > low) & (x < high))


@register_jitable
def direction(w):
    """The sign of a velocity, smoothed below a thousandth of the largest velocity, so
    that an integrator does not stall where the rig sticks.
    """
    return np.tanh(w / 1e-3)


def _spring_and_damper(own, u, rate, hertz):
    """A damper in series with a spring, whose force relaxes."""
    return (rate - own[0] * 1.5 * hertz,)


def _hysteresis(own, u, rate, hertz):
    """A Bouc-Wen law that yields within a quarter of the range."""
    z = own[0]
    return (4 * rate - 2 * (abs(rate) * z * abs(z) + rate * z * z),)


def _resonance(own, u, rate, hertz):
    """A lightly damped oscillator at 3.7 times the drive frequency, driven by the
    deflection.
    """
    w = 2 * np.pi * 3.7 * hertz
    return (own[1], w * w * (u - own[0]) - 0.08 * w * own[1])


def _force(arguments, value, low, high, **more) -> Effect:
    return Effect("force", arguments, value, (low, high), **more)


_AT_PLACE, _AT_SPEED, _ON_THE_WAY = (
    ("position",),
    ("velocity",),
    ("position", "velocity"),
)

EFFECTS = {
    # forces as a function of position
    "stop": _force(
        _AT_PLACE, lambda u, w, phi, t, s: -np.maximum(u - 0.6, 0), 0.2, 0.6
    ),
    "hardening_side": _force(
        _AT_PLACE, lambda u, w, phi, t, s: np.maximum(-u - 0.2, 0) ** 2, 0.15, 0.4
    ),
    "magnet": _force(
        _AT_PLACE,
        lambda u, w, phi, t, s: np.exp(-(((u - 0.3) / 0.2) ** 2)),
        0.03,
        0.1,
    ),
    "detent": _force(
        _AT_PLACE,
        lambda u, w, phi, t, s: (0.2 - u) * np.exp(-0.5 * ((u - 0.2) / 0.15) ** 2),
        0.3,
        0.9,
    ),
    "detents": _force(
        _AT_PLACE, lambda u, w, phi, t, s: np.sin(2 * np.pi * 1.8 * u), 0.03, 0.1
    ),
    "backlash": _force(
        _AT_PLACE,
        lambda u, w, phi, t, s: np.minimum(np.maximum(u, -0.3), 0.3) - u,
        0.15,
        0.5,
    ),
    "double_well": _force(_AT_PLACE, lambda u, w, phi, t, s: u - 2.2 * u**3, 0.06, 0.2),
    "two_wells": _force(
        _AT_PLACE,
        lambda u, w, phi, t, s: (
            np.exp(-(((u - 0.45) / 0.12) ** 2))
            - 0.7 * np.exp(-(((u + 0.3) / 0.15) ** 2))
        ),
        0.04,
        0.12,
    ),
    "shelf": _force(
        _AT_PLACE, lambda u, w, phi, t, s: -np.tanh((u - 0.1) / 0.15), 0.03, 0.1
    ),
    # of velocity
    "fast_drag": _force(
        _AT_SPEED,
        lambda u, w, phi, t, s: -np.sign(w) * np.maximum(np.abs(w) - 0.4, 0),
        0.08,
        0.25,
    ),
    "stick_slip": _force(
        _AT_SPEED,
        lambda u, w, phi, t, s: -direction(w) * np.exp(-((w / 0.15) ** 2)),
        0.02,
        0.06,
    ),
    "one_way": _force(_AT_SPEED, lambda u, w, phi, t, s: -1.0 * (w > 0), 0.02, 0.06),
    "cubic_drag": _force(_AT_SPEED, lambda u, w, phi, t, s: -(w**3), 0.08, 0.25),
    "root_drag": _force(
        _AT_SPEED,
        lambda u, w, phi, t, s: -np.sign(w) * np.sqrt(np.abs(w)),
        0.03,
        0.1,
    ),
    "one_way_fast": _force(
        _AT_SPEED, lambda u, w, phi, t, s: -(np.maximum(w - 0.3, 0) ** 2), 0.1, 0.4
    ),
    # of position and velocity
    "zone_friction": _force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -np.sign(w) * _within(u, -0.1, 0.5),
        0.01,
        0.03,
    ),
    "rough_end": _force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -w * np.maximum(u, 0) ** 2,
        0.05,
        0.2,
    ),
    "eddy_brake": _force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -w * np.exp(-(((u + 0.2) / 0.25) ** 2)),
        0.05,
        0.15,
    ),
    "fat_friction": _force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -direction(w) * u**2, 0.02, 0.06
    ),
    "centrifugal": _force(_ON_THE_WAY, lambda u, w, phi, t, s: u * w**2, 0.1, 0.3),
    "lever": _force(_ON_THE_WAY, lambda u, w, phi, t, s: -u * w, 0.05, 0.15),
    # products of two functions of one argument
    "zone_damper": _force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -w * _within(u, 0.1, 0.6), 0.05, 0.15
    ),
    "zone_cubic": _force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -(w**3) * _within(u, -0.2, 0.5), 0.1, 0.3
    ),
    "softening": _force(
        _ON_THE_WAY, lambda u, w, phi, t, s: u * np.exp(-((w / 0.4) ** 2)), 0.04, 0.12
    ),
    "pulled_end": _force(
        ("phase", "position"),
        lambda u, w, phi, t, s: np.cos(phi - 1.0) * (u > 0.2),
        0.04,
        0.12,
    ),
    # other functions of two arguments
    "moving_stop": _force(
        ("phase", "position"),
        lambda u, w, phi, t, s: -np.maximum(u - 0.4 + 0.2 * np.cos(phi), 0),
        0.2,
        0.5,
    ),
    "moving_belt": _force(
        ("phase", "velocity"),
        lambda u, w, phi, t, s: -np.tanh((w - 0.4 * np.cos(phi)) / 0.05),
        0.02,
        0.06,
    ),
    "travelling_wave": _force(
        ("phase", "position"), lambda u, w, phi, t, s: np.cos(phi - 4 * u), 0.02, 0.06
    ),
    "lossy_stop": _force(
        _ON_THE_WAY,
        lambda u, w, phi, t, s: -(np.maximum(u - 0.4, 0) ** 1.5) * (1 + 0.8 * w),
        0.3,
        0.8,
    ),
    "late_spring": _force(
        _ON_THE_WAY, lambda u, w, phi, t, s: -np.maximum(u + 0.3 * w - 0.3, 0), 0.2, 0.5
    ),
    # of the drive angle
    "pulse": _force(
        ("phase",), lambda u, w, phi, t, s: 1.0 * (np.cos(phi - 2.0) > 0.6), 0.02, 0.06
    ),
    "parametric": _force(
        ("phase", "position"),
        lambda u, w, phi, t, s: u * np.cos(2 * phi - 1.0),
        0.03,
        0.1,
    ),
    "ratchet": _force(
        ("phase",),
        lambda u, w, phi, t, s: np.cos(2 * phi) + 0.5 * np.sin(3 * phi),
        0.02,
        0.06,
    ),
    "pumping": _force(
        ("phase", "velocity"),
        lambda u, w, phi, t, s: -w * np.cos(phi - 0.5),
        0.05,
        0.15,
    ),
    "lobes": _force(
        ("phase",),
        lambda u, w, phi, t, s: (
            np.exp(3 * (np.cos(phi - 4) - 1))
            - 0.6 * np.exp(6 * (np.cos(phi - 1.2) - 1))
        ),
        0.02,
        0.06,
    ),
    "grip": _force(
        ("phase", "velocity"),
        lambda u, w, phi, t, s: -direction(w) * (np.cos(phi - 2) > 0.2),
        0.02,
        0.06,
    ),
    # of time
    "ramp": _force(("time",), lambda u, w, phi, t, s: t, 0.02, 0.06),
    "jolt": _force(("time",), lambda u, w, phi, t, s: 1.0 * (t > 0.55), 0.02, 0.06),
    "warming": _force(("time", "velocity"), lambda u, w, phi, t, s: w * t, 0.02, 0.06),
    "fading": _force(("time",), lambda u, w, phi, t, s: np.exp(-5 * t), 0.02, 0.06),
    "seizing": _force(
        ("time", "velocity"),
        lambda u, w, phi, t, s: -np.sign(w) * t,
        0.01,
        0.03,
    ),
    "burst": _force(
        ("time",), lambda u, w, phi, t, s: _within(t, 0.3, 0.45), 0.03, 0.08
    ),
    "stiff_later": _force(
        ("time", "position"), lambda u, w, phi, t, s: -u * (t > 0.5), 0.05, 0.15
    ),
    "settling": _force(
        ("time", "position"), lambda u, w, phi, t, s: -u * np.exp(-4 * t), 0.05, 0.15
    ),
    "leak": _force(
        ("time", "velocity"), lambda u, w, phi, t, s: w * (t > 0.6), 0.05, 0.15
    ),
    # with memory
    "relaxing": _force(
        ("memory",),
        lambda u, w, phi, t, own: -own,
        0.1,
        0.3,
        memory=_spring_and_damper,
        states=1,
    ),
    "hysteresis": _force(
        ("memory",),
        lambda u, w, phi, t, own: -own,
        0.02,
        0.06,
        memory=_hysteresis,
        states=1,
    ),
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


class Scales(NamedTuple):
    """The scales of effects, from the motion of a rig without an effect."""

    middle: float
    reach: float
    velocity: float
    acceleration: float
    noise: float
    lasts: float
    hertz: float


class Hidden(NamedTuple):
    """An effect of given size, in the units of the rig."""

    effect: Effect
    size: float
    scales: Scales

    def at(self, x, v, phi, t, s=0.0):
        """The value of the effect, including any part that the rig parameters can
        represent.
        """
        scales = self.scales
        share = np.clip(t / scales.lasts, 0.0, 1.0)
        u = (x - scales.middle) / scales.reach
        w = v / scales.velocity
        return self.unit * self.effect.value(u, w, phi, share, s)

    @property
    def unit(self) -> float:
        """The size of the effect in the units of the rig."""
        scales = self.scales
        units = {"force": scales.acceleration, "resonance": scales.acceleration}
        units |= {"surface": scales.noise, "sensor": scales.noise}
        return self.size * units.get(self.effect.kind, 1.0)

    def rates(self, own, x, v):
        """Rates of change of the effect's own states."""
        scales = self.scales
        if self.effect.memory is None:
            return ()
        u, rate = (x - scales.middle) / scales.reach, v / scales.reach
        return self.effect.memory(own, u, rate, scales.hertz)


def by_kind(hidden: Sequence[Hidden]) -> dict[str, Hidden]:
    """Effects by their kind; several of the same kind are added up."""
    kinds = dict.fromkeys(one.effect.kind for one in hidden)
    return {
        kind: _added([one for one in hidden if one.effect.kind == kind])
        for kind in kinds
    }


def _added(hidden: Sequence[Hidden]) -> Hidden:
    """One effect in place of several of the same kind, at most one with memory."""
    if len(hidden) == 1:
        return hidden[0]
    first, second, *more = hidden
    scales, effect, other = first.scales, first.effect, second.effect
    own = second.scales
    # numba compiles functions of functions that are marked
    values = register_jitable(effect.value), register_jitable(other.value)
    one, another = values
    share = second.unit / first.unit
    stretch, fast = scales.reach / own.reach, scales.velocity / own.velocity
    shift = (scales.middle - own.middle) / own.reach

    def value(u, w, phi, t, s):
        return one(u, w, phi, t, s) + share * another(
            stretch * u + shift, fast * w, phi, t, s
        )

    (memory, states), *_ = sorted(
        ((e.memory, e.states) for e in (effect, other)), key=lambda pair: -pair[1]
    )
    arguments = tuple(dict.fromkeys((*effect.arguments, *other.arguments)))
    both = Effect(effect.kind, arguments, value, effect.size, memory, states)
    return _added([Hidden(both, first.size, scales), *more])
