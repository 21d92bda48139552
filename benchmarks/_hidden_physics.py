"""Effects that a textbook model lacks, for the rigs of `_own_rig_makers.py`.

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
def direction(w):
    """The sign of a velocity, smoothed below a thousandth of the largest velocity, so
    that an integrator does not stall where the rig sticks.
    """
    return np.tanh(w / 1e-3)


def force(arguments, value, low, high, **more) -> Effect:
    """A force between two sizes."""
    return Effect("force", arguments, value, (low, high), **more)


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
    # the states of an effect with memory depend on its own scales
    first, second, *more = sorted(hidden, key=lambda one: -one.effect.states)
    if second.effect.states:
        raise ValueError("Two effects of one kind have a memory; give one of them.")
    scales, effect, other = first.scales, first.effect, second.effect
    own = second.scales
    # numba compiles functions of functions that are marked
    one, another = (register_jitable(e.value) for e in (effect, other))
    share = second.unit / first.unit
    stretch, fast = scales.reach / own.reach, scales.velocity / own.velocity
    shift = (scales.middle - own.middle) / own.reach
    # the last argument is an approach speed, or the state of an effect with memory
    faster = fast if effect.kind == "restitution" else 1.0

    def value(u, w, phi, t, s):
        return one(u, w, phi, t, s) + share * another(
            stretch * u + shift, fast * w, phi, t, faster * s
        )

    arguments = tuple(dict.fromkeys((*effect.arguments, *other.arguments)))
    both = effect._replace(arguments=arguments, value=value)
    return _added([Hidden(both, first.size, scales), *more])
