"""Forces, restitution, surfaces and sensor errors as functions of one variable.

A shape is not a verdict. If no named term explains the residual, a shape shows where
the residual occurs and how it varies.
"""

import abc
import enum
import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ...fitting import Parameter
from ...recordings import References
from ._term import constant, Motion, Term, terms_of
from ._where import Where


# Limit of the scaled variable, just inside its ends at +-1, where the angle of a
# Chebyshev polynomial is not differentiable
_END = 1 - 1e-12


class Variable(enum.StrEnum):
    """An argument of a free function, as a string such as `"position"`."""

    POSITION = "position"
    VELOCITY = "velocity"
    APPROACH = "approach speed"
    PHASE = "phase"
    TIME = "time"


def _number(value):
    return jnp.asarray(value, dtype=float)


def _numbers(values):
    return tuple(jnp.asarray(value, dtype=float) for value in values)


class Shape(Term):
    """A sum of functions of one variable, each with a coefficient.

    `quantity` is the quantity that the sum describes, `unit` the unit of the
    coefficients, `count` their number, and `size` a significant change.
    """

    listed: ClassVar[bool] = False
    unit: ClassVar[str] = "[q]/s^2"
    size: ClassVar[float] = 0.1
    quantity: ClassVar[str] = "force"
    variable: ClassVar[Variable]
    count: ClassVar[int]
    coefficients: tuple[Array, ...] = eqx.field(converter=_numbers)

    @abc.abstractmethod
    def basis(self, quantity) -> Array:
        """Return the functions at one value of the variable, shape `(k,)`."""

    @property
    @abc.abstractmethod
    def ends(self) -> tuple[float, float]:
        """Return the smallest and largest value of the variable."""

    def value(self, quantity):
        """Return the sum of the functions."""
        return jnp.stack(self.coefficients) @ self.basis(quantity)

    def numbers(self) -> tuple[Array, ...]:
        return self.coefficients

    def parameters(self, place: int) -> list[Parameter]:
        return [
            Parameter(
                f"{self.name}_{k}",
                lambda m, k=k: terms_of(m)[place].coefficients[k],  # pyright: ignore
                scale=self.size,
                unit=self.written(self.unit),
            )
            for k in range(len(self.coefficients))
        ]


class Polynomial(Shape):
    """Chebyshev polynomials between two ends; `first` is the lowest degree."""

    low: Array = eqx.field(converter=_number)
    high: Array = eqx.field(converter=_number)
    first: int = eqx.field(default=1, static=True)

    def basis(self, quantity) -> Array:
        middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
        x = jnp.clip((quantity - middle) / half, -_END, _END)
        # all degrees at once, because a recurrence would be compiled degree by degree
        last = self.first + len(self.coefficients)
        degrees = jnp.arange(self.first, last, dtype=float)
        return jnp.cos(degrees * jnp.arccos(x))

    @property
    def ends(self) -> tuple[float, float]:
        return float(self.low), float(self.high)


class Harmonics(Shape):
    """Cosines, then sines, of multiples of the phase; `first` is the lowest order."""

    first: int = eqx.field(default=1, static=True)

    def basis(self, quantity) -> Array:
        half = len(self.coefficients) // 2
        orders = jnp.arange(self.first, self.first + half, dtype=float)
        angles = orders * quantity
        return jnp.concatenate([jnp.cos(angles), jnp.sin(angles)])

    @property
    def ends(self) -> tuple[float, float]:
        return 0.0, 2 * math.pi


class ForceOfAngle(Polynomial):
    name: ClassVar[str] = "force_of_position"
    sentence: ClassVar[str] = "a force that depends on the position"
    region: ClassVar[str] = "in flight, as a function of position"
    variable: ClassVar[Variable] = Variable.POSITION
    count: ClassVar[int] = 6

    def acceleration(self, motion: Motion):
        return self.value(motion.position)


class ForceOfVelocity(Polynomial):
    name: ClassVar[str] = "force_of_velocity"
    sentence: ClassVar[str] = "a force that depends on the velocity"
    region: ClassVar[str] = "in flight, as a function of velocity"
    variable: ClassVar[Variable] = Variable.VELOCITY
    count: ClassVar[int] = 6

    def acceleration(self, motion: Motion):
        return self.value(motion.velocity)


class ForceOfTime(Polynomial):
    name: ClassVar[str] = "force_of_time"
    sentence: ClassVar[str] = "a force that varies during a recording"
    region: ClassVar[str] = "in flight, as a function of time"
    variable: ClassVar[Variable] = Variable.TIME
    count: ClassVar[int] = 5

    def acceleration(self, motion: Motion):
        return self.value(motion.t)


class FrictionOfAngle(Polynomial):
    name: ClassVar[str] = "friction_of_position"
    sentence: ClassVar[str] = "friction that depends on the position"
    region: ClassVar[str] = (
        "in flight, as a function of position and direction of motion"
    )
    quantity: ClassVar[str] = "friction"
    variable: ClassVar[Variable] = Variable.POSITION
    count: ClassVar[int] = 3

    slip: float = constant(References.free_slip_speed)

    def acceleration(self, motion: Motion):
        return -self.value(motion.position) * jnp.tanh(motion.velocity / self.slip)


class ForceOfPhase(Harmonics):
    name: ClassVar[str] = "force_of_phase"
    sentence: ClassVar[str] = "a force that depends on the drive phase"
    region: ClassVar[str] = "in flight, as a function of drive phase"
    variable: ClassVar[Variable] = Variable.PHASE
    count: ClassVar[int] = 8

    def acceleration(self, motion: Motion):
        return self.value(motion.phase)


class SurfaceOfPhase(Harmonics):
    name: ClassVar[str] = "surface_of_phase"
    sentence: ClassVar[str] = "a surface that deviates from that of the model"
    where: ClassVar[str] = Where.CONTACT
    region: ClassVar[str] = "at impacts and in contact, as a function of drive phase"
    quantity: ClassVar[str] = "surface"
    variable: ClassVar[Variable] = Variable.PHASE
    count: ClassVar[int] = 8
    unit: ClassVar[str] = "[q]"
    size: ClassVar[float] = 1e-4

    def contact(self, motion: Motion):
        return self.value(motion.phase)


class RestitutionOfSpeed(Polynomial):
    name: ClassVar[str] = "restitution_of_speed"
    sentence: ClassVar[str] = (
        "a coefficient of restitution that depends on the approach speed"
    )
    where: ClassVar[str] = Where.IMPACT
    region: ClassVar[str] = "at impacts, as a function of approach speed"
    quantity: ClassVar[str] = "restitution"
    variable: ClassVar[Variable] = Variable.APPROACH
    count: ClassVar[int] = 4
    unit: ClassVar[str] = "-"
    size: ClassVar[float] = 0.01

    def restitution(self, approach, motion: Motion):
        return 1 + self.value(approach)


class RestitutionOfTime(Polynomial):
    name: ClassVar[str] = "restitution_of_time"
    sentence: ClassVar[str] = (
        "a coefficient of restitution that varies during a recording"
    )
    where: ClassVar[str] = Where.IMPACT
    region: ClassVar[str] = "at impacts, as a function of time"
    quantity: ClassVar[str] = "restitution"
    variable: ClassVar[Variable] = Variable.TIME
    count: ClassVar[int] = 3
    unit: ClassVar[str] = "-"
    size: ClassVar[float] = 0.01

    def restitution(self, approach, motion: Motion):
        del approach
        return 1 + self.value(motion.t)


class RestitutionOfPhase(Harmonics):
    name: ClassVar[str] = "restitution_of_phase"
    sentence: ClassVar[str] = (
        "a coefficient of restitution that depends on the drive phase"
    )
    where: ClassVar[str] = Where.IMPACT
    region: ClassVar[str] = "at impacts, as a function of drive phase"
    quantity: ClassVar[str] = "restitution"
    variable: ClassVar[Variable] = Variable.PHASE
    count: ClassVar[int] = 4
    unit: ClassVar[str] = "-"
    size: ClassVar[float] = 0.01

    def restitution(self, approach, motion: Motion):
        del approach
        return 1 + self.value(motion.phase)


class SensorOfPosition(Polynomial):
    name: ClassVar[str] = "sensor_of_position"
    sentence: ClassVar[str] = "a sensor error that depends on the position"
    where: ClassVar[str] = Where.SENSOR
    region: ClassVar[str] = "in the measured motion, as a function of position"
    quantity: ClassVar[str] = "sensor"
    variable: ClassVar[Variable] = Variable.POSITION
    count: ClassVar[int] = 5
    unit: ClassVar[str] = "[q]"
    size: ClassVar[float] = 1e-4

    def sensed(self, motion: Motion):
        return self.value(motion.position)


class SensorOfTime(Polynomial):
    name: ClassVar[str] = "sensor_of_time"
    sentence: ClassVar[str] = "a sensor error that drifts during a recording"
    where: ClassVar[str] = Where.SENSOR
    region: ClassVar[str] = "in the measured motion, as a function of time"
    quantity: ClassVar[str] = "sensor"
    variable: ClassVar[Variable] = Variable.TIME
    count: ClassVar[int] = 4
    unit: ClassVar[str] = "[q]"
    size: ClassVar[float] = 1e-4

    def sensed(self, motion: Motion):
        return self.value(motion.t)


class SensorOfPhase(Harmonics):
    name: ClassVar[str] = "sensor_of_phase"
    sentence: ClassVar[str] = "a sensor error that depends on the drive phase"
    where: ClassVar[str] = Where.SENSOR
    region: ClassVar[str] = "in the measured motion, as a function of drive phase"
    quantity: ClassVar[str] = "sensor"
    variable: ClassVar[Variable] = Variable.PHASE
    count: ClassVar[int] = 6
    unit: ClassVar[str] = "[q]"
    size: ClassVar[float] = 1e-4

    def sensed(self, motion: Motion):
        return self.value(motion.phase)


def shapes(
    positions: tuple[float, float],
    velocities: tuple[float, float],
    approach: tuple[float, float],
    times: tuple[float, float],
    turned: bool = True,
    references: References = References(),
) -> tuple[Shape, ...]:
    """Return all shapes, over the ranges that the recordings visit.

    **Arguments:** smallest and largest position, velocity, approach speed and time (s),
    whether there is a drive with a phase, and the
    constants of the terms.
    """

    def zeros(kind: type[Shape]) -> list[float]:
        return [0.0] * kind.count

    slip = references.free_slip_speed
    found: list[Shape] = [
        ForceOfAngle(zeros(ForceOfAngle), *positions),
        ForceOfVelocity(zeros(ForceOfVelocity), *velocities),
        ForceOfTime(zeros(ForceOfTime), *times),
        FrictionOfAngle(zeros(FrictionOfAngle), *positions, first=0, slip=slip),
        RestitutionOfSpeed(zeros(RestitutionOfSpeed), *approach),
        RestitutionOfTime(zeros(RestitutionOfTime), *times),
        # no degrees 0 and 1, which are an offset and a gain error of the sensor
        SensorOfPosition(zeros(SensorOfPosition), *positions, first=2),
        SensorOfTime(zeros(SensorOfTime), *times),
    ]
    if turned:
        found += [
            ForceOfPhase(zeros(ForceOfPhase)),
            SurfaceOfPhase(zeros(SurfaceOfPhase), first=2),
            RestitutionOfPhase(zeros(RestitutionOfPhase)),
            SensorOfPhase(zeros(SensorOfPhase)),
        ]
    return tuple(found)
