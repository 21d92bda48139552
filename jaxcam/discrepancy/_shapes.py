"""Forces, bounces and surfaces as free functions of one quantity: where to look.

A shape is no verdict. Where no named term explains what is left, the shape says where
it is and what it looks like.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..fitting import Parameter
from ._term import Motion, Term, terms_of


# Just inside the ends, where the angle of a Chebyshev polynomial can be differentiated
_END = 1 - 1e-12


def _number(value):
    return jnp.asarray(value, dtype=float)


def _numbers(values):
    return tuple(jnp.asarray(value, dtype=float) for value in values)


class Shape(Term):
    """A sum of functions of one quantity, each with a coefficient.

    `unit` is that of the coefficients, `size` a change that matters; `variable` names
    the quantity.
    """

    listed: ClassVar[bool] = False
    unit: ClassVar[str] = "rad/s^2"
    size: ClassVar[float] = 0.1
    variable: ClassVar[str] = ""
    coefficients: tuple[Array, ...] = eqx.field(converter=_numbers)

    @abc.abstractmethod
    def basis(self, quantity) -> Array:
        """The functions at one value of the quantity, shape `(k,)`."""

    def value(self, quantity):
        """The sum of the functions."""
        return jnp.stack(self.coefficients) @ self.basis(quantity)

    def numbers(self) -> tuple[Array, ...]:
        return self.coefficients

    def parameters(self, place: int) -> list[Parameter]:
        return [
            Parameter(
                f"{self.name}_{k}",
                lambda m, k=k: terms_of(m)[place].coefficients[k],  # pyright: ignore
                scale=self.size,
                unit=self.unit,
            )
            for k in range(len(self.coefficients))
        ]


class Polynomial(Shape):
    """Chebyshev polynomials between two ends, `first` is the lowest degree."""

    low: Array = eqx.field(converter=_number)
    high: Array = eqx.field(converter=_number)
    first: int = eqx.field(default=1, static=True)

    def basis(self, quantity) -> Array:
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        x = jnp.clip((quantity - middle) / half, -_END, _END)
        # all at once: a recurrence would be compiled degree by degree
        last = self.first + len(self.coefficients)
        degrees = jnp.arange(self.first, last, dtype=float)
        return jnp.cos(degrees * jnp.arccos(x))


class Harmonics(Shape):
    """Cosines, then sines, of multiples of the phase, `first` is the lowest order."""

    first: int = eqx.field(default=1, static=True)

    def basis(self, quantity) -> Array:
        half = len(self.coefficients) // 2
        orders = jnp.arange(self.first, self.first + half, dtype=float)
        angles = orders * quantity
        return jnp.concatenate([jnp.cos(angles), jnp.sin(angles)])


class ForceOfAngle(Polynomial):
    name: ClassVar[str] = "force_of_angle"
    sentence: ClassVar[str] = "a force that depends on the position"
    region: ClassVar[str] = "in flight, by position"
    variable: ClassVar[str] = "position"

    def acceleration(self, motion: Motion):
        return self.value(motion.position)


class ForceOfVelocity(Polynomial):
    name: ClassVar[str] = "force_of_velocity"
    sentence: ClassVar[str] = "a force that depends on the velocity"
    region: ClassVar[str] = "in flight, by velocity"
    variable: ClassVar[str] = "velocity"

    def acceleration(self, motion: Motion):
        return self.value(motion.velocity)


class ForceOfTime(Polynomial):
    name: ClassVar[str] = "force_of_time"
    sentence: ClassVar[str] = "a force that changes in the course of a record"
    region: ClassVar[str] = "in flight, by time of the record"
    variable: ClassVar[str] = "time"

    def acceleration(self, motion: Motion):
        return self.value(motion.t)


class FrictionOfAngle(Polynomial):
    name: ClassVar[str] = "friction_of_angle"
    sentence: ClassVar[str] = "friction that depends on the position"
    region: ClassVar[str] = "in flight, by position and direction of motion"
    variable: ClassVar[str] = "position"

    def acceleration(self, motion: Motion):
        return -self.value(motion.position) * jnp.tanh(motion.velocity / 0.01)


class ForceOfPhase(Harmonics):
    name: ClassVar[str] = "force_of_phase"
    sentence: ClassVar[str] = "a force in step with the drive"
    region: ClassVar[str] = "in flight, by phase of the drive"
    variable: ClassVar[str] = "phase"

    def acceleration(self, motion: Motion):
        return self.value(motion.phase)


class SurfaceOfPhase(Harmonics):
    name: ClassVar[str] = "surface_of_phase"
    sentence: ClassVar[str] = "a surface that is not where the model has it"
    where: ClassVar[str] = "contact"
    region: ClassVar[str] = "at impacts and rests, by phase of the drive"
    variable: ClassVar[str] = "phase"
    unit: ClassVar[str] = "rad"
    size: ClassVar[float] = 1e-4
    acts: ClassVar[tuple[str, ...]] = ("contact",)

    def contact(self, motion: Motion):
        return self.value(motion.phase)


class BounceOfSpeed(Polynomial):
    name: ClassVar[str] = "bounce_of_speed"
    sentence: ClassVar[str] = "a restitution that depends on the approach speed"
    where: ClassVar[str] = "impact"
    region: ClassVar[str] = "at impacts, by approach speed"
    variable: ClassVar[str] = "approach speed"
    unit: ClassVar[str] = "-"
    size: ClassVar[float] = 0.01
    acts: ClassVar[tuple[str, ...]] = ("impact",)

    def restitution(self, approach, motion: Motion):
        return 1 + self.value(approach)


class BounceOfTime(Polynomial):
    name: ClassVar[str] = "bounce_of_time"
    sentence: ClassVar[str] = "a restitution that changes in the course of a record"
    where: ClassVar[str] = "impact"
    region: ClassVar[str] = "at impacts, by time of the record"
    variable: ClassVar[str] = "time"
    unit: ClassVar[str] = "-"
    size: ClassVar[float] = 0.01
    acts: ClassVar[tuple[str, ...]] = ("impact",)

    def restitution(self, approach, motion: Motion):
        del approach
        return 1 + self.value(motion.t)


class BounceOfPhase(Harmonics):
    name: ClassVar[str] = "bounce_of_phase"
    sentence: ClassVar[str] = "a restitution that depends on where the drive is"
    where: ClassVar[str] = "impact"
    region: ClassVar[str] = "at impacts, by phase of the drive"
    variable: ClassVar[str] = "phase"
    unit: ClassVar[str] = "-"
    size: ClassVar[float] = 0.01
    acts: ClassVar[tuple[str, ...]] = ("impact",)

    def restitution(self, approach, motion: Motion):
        del approach
        return 1 + self.value(motion.phase)


def shapes(
    positions: tuple[float, float],
    velocities: tuple[float, float],
    approach: tuple[float, float],
    duration: float,
    turned: bool = True,
) -> tuple[Shape, ...]:
    """All shapes, over the ranges that some recordings visit.

    **Arguments:** least and largest position, velocity and approach speed, length of
    the records (s), and whether there is a drive with a phase.
    """
    found: list[Shape] = [
        ForceOfAngle([0.0] * 6, *positions),
        ForceOfVelocity([0.0] * 6, *velocities),
        ForceOfTime([0.0] * 5, 0.0, duration),
        FrictionOfAngle([0.0] * 3, *positions, first=0),
        BounceOfSpeed([0.0] * 4, *approach),
        BounceOfTime([0.0] * 3, 0.0, duration),
    ]
    if turned:
        found += [
            ForceOfPhase([0.0] * 8),
            SurfaceOfPhase([0.0] * 8, first=2),
            BounceOfPhase([0.0] * 4),
        ]
    return tuple(found)
