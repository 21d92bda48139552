"""Elements with a state of their own that a coordinate drives: what pushes back later.

The position of a coordinate is continuous through impacts, and so is the state of an
element that it drives.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...parameters import FloatScalar


def _number(value) -> Array:
    return jnp.asarray(value, dtype=float)


def _field(default: float = 0.0):
    return eqx.field(default=default, converter=_number)


class HiddenElement(eqx.Module):
    """A hidden state and the force that it gives, per unit of mass.

    Besides, the force has parts by the deflection of the coordinate from `middle` and
    by its velocity, and a constant: `stiffness`, `damping`, `constant`. A transfer
    function has them where a resonance does not explain all of it.
    """

    names: ClassVar[tuple[str, ...]]

    constant: eqx.AbstractVar[FloatScalar]
    stiffness: eqx.AbstractVar[FloatScalar]
    damping: eqx.AbstractVar[FloatScalar]
    middle: eqx.AbstractVar[FloatScalar]

    @abc.abstractmethod
    def units(self, unit: str) -> tuple[str, ...]:
        """Units of the hidden state, by that of the coordinate."""

    @abc.abstractmethod
    def scales(self) -> tuple[FloatScalar, ...]:
        """Numbers that must be positive."""

    def check(self) -> None:
        """**Raises:** `ValueError` for a number that has no meaning."""
        if not all(float(one) > 0 for one in self.scales()):
            raise ValueError(
                f"{type(self).__name__}: its frequency, time, limit or power must be "
                f"positive."
            )

    @abc.abstractmethod
    def rate(self, position, velocity, hidden: Float[Array, " h"]) -> Array:
        """Rate of change of the hidden state."""

    @abc.abstractmethod
    def push(self, hidden: Float[Array, " h"]) -> Array:
        """Acceleration by the hidden state alone."""

    def force(self, position, velocity, hidden: Float[Array, " h"]) -> Array:
        """Acceleration of the coordinate."""
        direct = self.stiffness * (position - self.middle) + self.damping * velocity
        return self.push(hidden) + direct + self.constant


class Resonator(HiddenElement):
    """A resonance that the position drives, `z'' + 2 D w z' + w^2 z = q`.

    The force is `by_state * z + by_rate * z'`, with `w = 2 pi frequency` and the
    damping ratio D.
    """

    names: ClassVar[tuple[str, ...]] = ("hidden", "hidden_rate")

    frequency: FloatScalar = _field(1.0)
    ratio: FloatScalar = _field(0.1)
    by_state: FloatScalar = _field()
    by_rate: FloatScalar = _field()
    constant: FloatScalar = _field()
    stiffness: FloatScalar = _field()
    damping: FloatScalar = _field()
    middle: FloatScalar = _field()

    def units(self, unit):
        return f"{unit} s^2", f"{unit} s"

    def scales(self):
        return (self.frequency,)

    def rate(self, position, velocity, hidden):
        del velocity
        w = 2 * jnp.pi * self.frequency
        z, rate = hidden
        return jnp.stack([rate, position - w**2 * z - 2 * self.ratio * w * rate])

    def push(self, hidden):
        return self.by_state * hidden[0] + self.by_rate * hidden[1]

    def transfer(self, frequency):
        """Force over deflection at some frequencies (Hz), complex."""
        s = 2j * jnp.pi * frequency
        w = 2 * jnp.pi * self.frequency
        below = s**2 + 2 * self.ratio * w * s + w**2
        above = self.by_state + self.by_rate * s
        return above / below + self.stiffness + self.damping * s


class Relaxation(HiddenElement):
    """A spring and a dashpot in a row (Maxwell): `z' = v - z / time`, force `k z`."""

    names: ClassVar[tuple[str, ...]] = ("hidden",)

    time: FloatScalar = _field(1.0)
    by_state: FloatScalar = _field()
    constant: FloatScalar = _field()
    stiffness: FloatScalar = _field()
    damping: FloatScalar = _field()
    middle: FloatScalar = _field()

    def units(self, unit):
        return (unit,)

    def scales(self):
        return (self.time,)

    def rate(self, position, velocity, hidden):
        del position
        return velocity - hidden / self.time

    def push(self, hidden):
        return self.by_state * hidden[0]


class Hysteresis(HiddenElement):
    """Hysteresis of Bouc and Wen, `z' = v (1 - (d sign(v z) + 1 - d) |z / limit|^n)`.

    The force is `by_state * z`; `sharing` is d, `power` n.
    """

    names: ClassVar[tuple[str, ...]] = ("hidden",)

    limit: FloatScalar = _field(1.0)
    sharing: FloatScalar = _field(0.5)
    power: FloatScalar = _field(1.0)
    by_state: FloatScalar = _field()
    constant: FloatScalar = _field()
    stiffness: FloatScalar = _field()
    damping: FloatScalar = _field()
    middle: FloatScalar = _field()

    def units(self, unit):
        return (unit,)

    def scales(self):
        return self.limit, self.power

    def rate(self, position, velocity, hidden):
        del position
        return velocity * self.slope(velocity, hidden)

    def slope(self, direction, hidden):
        """`dz / dq` for a motion in some direction."""
        size = jnp.maximum(jnp.abs(hidden) / self.limit, 1e-12)
        turned = jnp.sign(direction * hidden)
        return 1 - (self.sharing * turned + 1 - self.sharing) * size**self.power

    def push(self, hidden):
        return self.by_state * hidden[0]
