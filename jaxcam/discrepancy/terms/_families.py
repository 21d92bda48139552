"""Families of free functions, defined by their arguments and where they act."""

import dataclasses
import enum
import math
from collections.abc import Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._parametric_form import Primitive
from ._primitives import (
    FROM_ZERO,
    OF_FACTORS,
    OF_PHASE,
    OF_POSITION,
    OF_SPEED,
    OF_TIME,
    ON_A_LINE,
    ONLY_IN_SUMS,
    STRAIGHT,
)
from ._shapes import Variable
from ._where import Where


# The domain of the sines extends beyond the data by this fraction at either end,
# because all sines vanish at its ends
_MARGIN = 0.15


class Factor(enum.StrEnum):
    """The factor of a free function, as a string such as `"velocity"`."""

    ONE = "one"
    VELOCITY = "velocity"
    DIRECTION = "direction"
    DEFLECTION = "deflection"


@dataclasses.dataclass(frozen=True)
class Family:
    """All functions of one argument, times a factor, that act in the same place.

    - `where`: `flight` (a force), `impact` (a factor on the coefficient of
        restitution), `contact` (a correction of the surface) or `sensor` (an addition
        to its reading).
    - `argument`: the variable, between `low` and `high`; `factor`: the factor of a
        force.
    - `middle`: position from which a deflection is measured.
    - `slip`: speed below which the sign of the velocity is smoothed.
    - `motion_unit`: unit of the coordinate.
    - `stride`: change of the argument of a force in one integration step of fast
        motion.
    - `constraint`: index of the gap to which an effect at impacts or of the surface
        belongs.
    """

    where: Where
    argument: Variable
    low: float
    high: float
    factor: Factor = Factor.ONE
    middle: float = 0.0
    slip: float = 0.01
    motion_unit: str = "rad"
    stride: float = 0.0
    constraint: int = 0

    @property
    def name(self) -> str:
        """Return location and arguments, such as `flight position velocity`."""
        parts = [self.where, self.argument]
        if self.factor is not Factor.ONE:
            parts.append(self.factor)
        if self.constraint:
            parts.append(f"gap {self.constraint + 1}")
        return " ".join(parts)

    @property
    def periodic(self) -> bool:
        return self.argument is Variable.PHASE

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of all arguments, including the factor."""
        names = [str(self.argument)]
        if self.factor in (Factor.VELOCITY, Factor.DIRECTION):
            names.append("velocity")
        elif self.factor is Factor.DEFLECTION:
            names.append("position")
        return tuple(dict.fromkeys(names))

    @property
    def jumps(self) -> bool:
        """Return whether the function may jump where the velocity changes sign."""
        return (
            self.where is Where.FLIGHT
            and self.argument is Variable.VELOCITY
            and self.factor is Factor.ONE
        )

    @property
    def primitives(self) -> tuple[Primitive, ...]:
        """Parametric forms that may replace a function of this family."""
        if self.periodic:
            return OF_PHASE
        if self.where is Where.SENSOR and self.argument is not Variable.TIME:
            # without a straight line, because gain and lag of a sensor are named terms
            return tuple(one for one in ON_A_LINE if one is not STRAIGHT)
        if self.argument is Variable.TIME:
            return (*ON_A_LINE, *FROM_ZERO, *OF_TIME)
        if self.argument is Variable.APPROACH:
            return (*ON_A_LINE, *FROM_ZERO)
        if self.factor is not Factor.ONE:
            return (*ON_A_LINE, *OF_FACTORS)
        return (*ON_A_LINE, *(OF_SPEED if self.jumps else OF_POSITION))

    @property
    def summands(self) -> tuple[Primitive, ...]:
        """Parametric forms of which a sum may replace a function of this family."""
        return (*self.primitives, *(ONLY_IN_SUMS if self.jumps else ()))

    def has_sharp_edges(self, form: Primitive) -> bool:
        """Return whether a fit smooths the edges of a form only in derivatives.

        An edge lies between two impacts, and an impact near it belongs to one side. An
        edge of a force is integrated over, and a body may rest on a surface that
        depends on the phase.
        """
        moves = self.where is Where.CONTACT and self.argument is Variable.TIME
        at_impacts = self.where is Where.IMPACT or moves
        return at_impacts and form.sharp and not form.parts

    def waves(self, count: int) -> tuple[Array, Array]:
        """Return rates and shifts of `count` sines of the argument, each `(count,)`.

        For a phase, the first of them is a constant, because not every rig has a
        parameter that represents a constant, such as the rest position of a spring.
        """
        if self.periodic:
            cosines = np.arange(0.0, count // 2 + 1)
            sines = np.arange(1.0, count - len(cosines) + 1)
            rates = np.concatenate([cosines, sines])
            shifts = np.repeat([math.pi / 2, 0.0], [len(cosines), len(sines)])
        else:
            width = (self.high - self.low) * (1 + 2 * _MARGIN)
            rates = math.pi * np.arange(1.0, count + 1) / width
            shifts = rates * (_MARGIN * (self.high - self.low) - self.low)
        return jnp.asarray(rates), jnp.asarray(shifts)

    def variances(self, count: int, length: float) -> Float[np.ndarray, " count"]:
        """Return the variances of the coefficients of a function of variance one.

        `length`: correlation length, as a fraction of the range (in radians for a
        phase).
        """
        rates = np.asarray(self.waves(count)[0])
        unit = 1.0 if self.periodic else self.high - self.low
        # spectral density of a Matern kernel of order 3/2 in one dimension
        density = (1 + (rates * unit * length) ** 2 / 3) ** -2.0
        # a sine or cosine stands for rates of both signs, a constant for one rate only
        constant = rates == 0
        density = np.where(constant, density / 2, density)
        squares = np.where(constant, 1.0, 0.5)
        return density / np.sum(squares * density)

    def prior_variances(self, count: int, length: float) -> Float[np.ndarray, " count"]:
        """Return the variances of all coefficients; that of a jump, if the functions
        may jump, is one.
        """
        found = self.variances(count - 1, length)
        return np.append(found, float(self.jumps))


def free_basis(
    family: Family, at: Float[np.ndarray, " n"], count: int
) -> Float[np.ndarray, "n count"]:
    """Return the contribution of each coefficient of a function, without its factor."""
    rates, shifts = (np.asarray(x) for x in family.waves(count - 1))
    sines = np.sin(np.outer(at, rates) + shifts)
    jump = np.tanh(at / family.slip) if family.jumps else np.zeros(len(at))
    return np.column_stack([sines, jump])


def families(
    positions: tuple[float, float],
    velocities: tuple[float, float],
    approach: tuple[float, float],
    times: tuple[float, float],
    *,
    turned: bool,
    gaps: Sequence[int],
    slip: float,
    motion_unit: str,
    strides: Mapping[Variable, float],
) -> tuple[Family, ...]:
    """Return all families over the ranges that the recordings visit.

    **Arguments:** smallest and largest position, velocity, approach speed and time (s),
    whether there is a drive with a phase, the indices
    of the gaps with impacts, the slip speed, the unit of the motion, and the changes of
    the arguments in an integration step.
    """
    ranges = {
        Variable.POSITION: positions,
        Variable.VELOCITY: velocities,
        Variable.TIME: times,
        Variable.APPROACH: approach,
        Variable.PHASE: (0.0, 2 * math.pi),
    }

    def one(
        where: Where,
        argument: Variable,
        factor: Factor = Factor.ONE,
        constraint: int = 0,
    ) -> Family:
        return Family(
            where,
            argument,
            *ranges[argument],
            factor,
            sum(positions) / 2,
            slip,
            motion_unit,
            # only forces are integrated; other functions have no stride
            strides.get(argument, 0.0) if where is Where.FLIGHT else 0.0,
            constraint,
        )

    phase = (Variable.PHASE,) if turned else ()
    found = [
        one(Where.FLIGHT, argument, factor)
        for argument in (*_TIMELESS, Variable.TIME, *phase)
        for factor in Factor
        if (argument, factor) not in _DOUBLED
    ]
    for gap in gaps:
        found += [
            one(Where.IMPACT, argument, constraint=gap)
            for argument in (Variable.APPROACH, Variable.TIME, *phase)
        ]
        found += [
            one(Where.CONTACT, argument, constraint=gap)
            for argument in (Variable.TIME, *phase)
        ]
    found += [
        one(Where.SENSOR, argument) for argument in (*_TIMELESS, Variable.TIME, *phase)
    ]
    return tuple(found)


_TIMELESS = (Variable.POSITION, Variable.VELOCITY)
# combinations left out, because a function of the argument alone is equivalent
_DOUBLED = {
    (Variable.POSITION, Factor.DEFLECTION),
    (Variable.VELOCITY, Factor.VELOCITY),
    (Variable.VELOCITY, Factor.DIRECTION),
}
