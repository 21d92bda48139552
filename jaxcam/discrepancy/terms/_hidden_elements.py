"""Elements with an internal state, driven by a coordinate.

The position of a coordinate is continuous at impacts, and so is the state of an element
that it drives.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...parameters import FloatScalar


def _number(value) -> Array:
    return jnp.asarray(value, dtype=float)


def _field(default: float = 0.0):
    return eqx.field(default=default, converter=_number)


class HiddenElement(eqx.Module):
    """An internal state and the force that it exerts, per unit of mass.

    In addition, the force has a `constant` part, a part proportional to the deflection
    of the coordinate from `middle` (`stiffness`), and a part proportional to its
    velocity (`damping`). These parts are needed if the internal state alone does not
    represent the transfer function.
    """

    names: ClassVar[tuple[str, ...]]
    """Names of the components of the internal state."""

    constant: eqx.AbstractVar[FloatScalar]
    """Constant part of the acceleration."""
    stiffness: eqx.AbstractVar[FloatScalar]
    """Acceleration per unit of deflection (1/s^2)."""
    damping: eqx.AbstractVar[FloatScalar]
    """Acceleration per unit of velocity (1/s)."""
    middle: eqx.AbstractVar[FloatScalar]
    """Position from which the deflection is measured."""

    @abc.abstractmethod
    def units(self, unit: str) -> tuple[str, ...]:
        """Return the units of the internal state, given the unit of the coordinate."""

    @abc.abstractmethod
    def scales(self) -> tuple[FloatScalar, ...]:
        """Return the parameters that must be positive."""

    def check(self) -> None:
        """Check the parameters of the element.

        Raises:
            ValueError: A frequency, time, limit or power is not positive.
        """
        if not all(float(one) > 0 for one in self.scales()):
            raise ValueError(
                f"{type(self).__name__}: its frequency, time, limit or power must be "
                f"positive."
            )

    @abc.abstractmethod
    def rate(self, position, velocity, hidden: Float[Array, " h"]) -> Array:
        """Return the rate of change of the internal state."""

    @abc.abstractmethod
    def push(self, hidden: Float[Array, " h"]) -> Array:
        """Return the acceleration due to the internal state alone."""

    def force(self, position, velocity, hidden: Float[Array, " h"]) -> Array:
        """Return the acceleration of the coordinate."""
        direct = self.stiffness * (position - self.middle) + self.damping * velocity
        return self.push(hidden) + direct + self.constant


class Resonator(HiddenElement):
    """A resonator driven by the position q, `z'' + 2 D w z' + w^2 z = q`.

    The force is `by_state * z + by_rate * z'`, with `w = 2 pi frequency` and the
    damping ratio D.
    """

    names: ClassVar[tuple[str, ...]] = ("hidden", "hidden_rate")
    """Names of the components of the internal state."""

    frequency: FloatScalar = _field(1.0)
    """Natural frequency (Hz)."""
    ratio: FloatScalar = _field(0.1)
    """Damping ratio D."""
    by_state: FloatScalar = _field()
    """Acceleration per unit of the internal state."""
    by_rate: FloatScalar = _field()
    """Acceleration per unit of its rate of change."""
    constant: FloatScalar = _field()
    """Constant part of the acceleration."""
    stiffness: FloatScalar = _field()
    """Acceleration per unit of deflection (1/s^2)."""
    damping: FloatScalar = _field()
    """Acceleration per unit of velocity (1/s)."""
    middle: FloatScalar = _field()
    """Position from which the deflection is measured."""

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
        """Return the complex ratio of force to deflection at given frequencies (Hz)."""
        driven, w = 2 * jnp.pi * frequency, 2 * jnp.pi * self.frequency
        below = _complex(w**2 - driven**2, 2 * self.ratio * w * driven)
        above = _complex(self.by_state, self.by_rate * driven)
        return above / below + _complex(self.stiffness, self.damping * driven)


def _complex(real, imaginary):
    return jax.lax.complex(*jnp.broadcast_arrays(real, imaginary))


class Relaxation(HiddenElement):
    """A spring and a dashpot in series (Maxwell): `z' = v - z / time`.

    Here v is the velocity of the coordinate. The force is `by_state * z`.
    """

    names: ClassVar[tuple[str, ...]] = ("hidden",)
    """Names of the components of the internal state."""

    time: FloatScalar = _field(1.0)
    """Relaxation time (s)."""
    by_state: FloatScalar = _field()
    """Acceleration per unit of the internal state."""
    constant: FloatScalar = _field()
    """Constant part of the acceleration."""
    stiffness: FloatScalar = _field()
    """Acceleration per unit of deflection (1/s^2)."""
    damping: FloatScalar = _field()
    """Acceleration per unit of velocity (1/s)."""
    middle: FloatScalar = _field()
    """Position from which the deflection is measured."""

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
    """Bouc-Wen hysteresis, `z' = v (1 - c (b sign(v z) + 1 - b) |z / limit|^n)`.

    Here v is the velocity of the coordinate q. The force is `by_state * z`; b is
    `beta`, n is `power`, c is `loading`. With s = `|z / limit|^n`, the slope dz/dq is
    `1 - c s` during loading and `1 - c (1 - 2 b) s` during unloading (Wen 1976, where
    beta + gamma corresponds to c).
    """

    names: ClassVar[tuple[str, ...]] = ("hidden",)
    """Names of the components of the internal state."""

    limit: FloatScalar = _field(1.0)
    """Scale of the internal state, in the unit of the coordinate; this is the largest
    value of the state if `loading` is 1.
    """
    beta: FloatScalar = _field(0.5)
    """Coefficient b of the part that changes sign at a reversal. Energy is dissipated
    if `b * loading` is positive.
    """
    power: FloatScalar = _field(1.0)
    """Sharpness n of the transition."""
    by_state: FloatScalar = _field()
    """Acceleration per unit of the internal state."""
    constant: FloatScalar = _field()
    """Constant part of the acceleration."""
    stiffness: FloatScalar = _field()
    """Acceleration per unit of deflection (1/s^2)."""
    damping: FloatScalar = _field()
    """Acceleration per unit of velocity (1/s)."""
    middle: FloatScalar = _field()
    """Position from which the deflection is measured."""
    loading: int = eqx.field(default=1, static=True)
    """1 if the stiffness decreases during loading (slip), -1 if it increases."""

    def __check_init__(self):
        if self.loading not in (1, -1):
            raise ValueError(f"loading is 1 or -1, not {self.loading}.")

    def units(self, unit):
        return (unit,)

    def scales(self):
        return self.limit, self.power

    def rate(self, position, velocity, hidden):
        del position
        return velocity * self.slope(velocity, hidden)

    def slope(self, direction, hidden):
        """Return `dz / dq` for motion in a given direction."""
        size = jnp.maximum(jnp.abs(hidden) / self.limit, 1e-12)
        turned = self.beta * jnp.sign(direction * hidden) + 1 - self.beta
        return 1 - self.loading * turned * size**self.power

    def push(self, hidden):
        return self.by_state * hidden[0]
