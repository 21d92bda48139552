"""Free functions of one argument, times a factor, that are fitted with their roughness.

A function is a sum of sines whose coefficients have the variances of a Gaussian process
with a Matern kernel (Solin and Sarkka, Statistics and Computing 2020, eq. 55-59), or of
harmonics of the drive's phase with the same spectrum. So it is linear in what is
fitted, and its smoothness is one number.
"""

import dataclasses
import enum
import math
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...fitting import Parameter
from ._primitives import OF_PHASE, OF_SPEED, ON_A_LINE, Place, Primitive, PRIMITIVES
from ._shapes import Variable
from ._term import Motion, Term, terms_of
from ._where import Where


# Knots of the spline that stands for the sum of sines, six or more to a wave
_KNOTS = 64
# The domain of the sines is longer than that of the data by this share on either side,
# as they all vanish at its ends
_MARGIN = 0.15


class Factor(enum.StrEnum):
    """What a free function is multiplied with; equal to its name as a string."""

    ONE = "one"
    VELOCITY = "velocity"
    DIRECTION = "direction"
    DEFLECTION = "deflection"


#: arguments in the order of the weights that pick one of them
_ARGUMENTS = (Variable.POSITION, Variable.VELOCITY, Variable.PHASE, Variable.TIME)
_FACTORS = (Factor.ONE, Factor.VELOCITY, Factor.DIRECTION, Factor.DEFLECTION)


@dataclasses.dataclass(frozen=True)
class Family:
    """All functions of one argument, times a factor, that act in one place.

    - `where`: flight (a force), impact (a factor on the restitution) or contact (a
        surface). `argument` between `low` and `high`; `factor` of a force.
    - `middle`: of the positions, which a deflection is measured from. `slip`: speed
        below which a direction is smoothed.
    - `motion_unit`: of the coordinate.
    """

    where: Where
    argument: Variable
    low: float
    high: float
    factor: Factor = Factor.ONE
    middle: float = 0.0
    slip: float = 0.01
    motion_unit: str = "rad"

    @property
    def name(self) -> str:
        """Where and what of, such as `flight position velocity`."""
        parts = [self.where, self.argument]
        if self.factor is not Factor.ONE:
            parts.append(self.factor)
        return " ".join(parts)

    @property
    def periodic(self) -> bool:
        return self.argument is Variable.PHASE

    @property
    def arguments(self) -> tuple[str, ...]:
        """Names of what the function depends on, the factor included."""
        names = [str(self.argument)]
        if self.factor in (Factor.VELOCITY, Factor.DIRECTION):
            names.append("velocity")
        elif self.factor is Factor.DEFLECTION:
            names.append("position")
        return tuple(dict.fromkeys(names))

    @property
    def jumps(self) -> bool:
        """Whether the function may jump where the velocity changes sign."""
        return (
            self.where is Where.FLIGHT
            and self.argument is Variable.VELOCITY
            and self.factor is Factor.ONE
        )

    @property
    def primitives(self) -> tuple[Primitive, ...]:
        """Forms that a function of this family may turn out to have."""
        if self.periodic:
            return OF_PHASE
        return (*ON_A_LINE, *OF_SPEED) if self.jumps else ON_A_LINE

    def waves(self, count: int) -> tuple[Array, Array]:
        """Rates and shifts of `count` sines of the argument, each `(count,)`."""
        if self.periodic:
            half = count // 2
            orders = np.arange(1.0, half + 1)
            rates = np.concatenate([orders, orders])
            shifts = np.repeat([math.pi / 2, 0.0], half)
        else:
            width = (self.high - self.low) * (1 + 2 * _MARGIN)
            rates = math.pi * np.arange(1.0, count + 1) / width
            shifts = rates * (_MARGIN * (self.high - self.low) - self.low)
        return jnp.asarray(rates), jnp.asarray(shifts)

    def variances(self, count: int, length: float) -> Float[np.ndarray, " count"]:
        """Of the coefficients of a function of variance one, with this length of
        correlation, a share of the range (of a radian, for a phase)."""
        rates = np.asarray(self.waves(count)[0])
        unit = 1.0 if self.periodic else self.high - self.low
        # spectral density of a Matern kernel of order 3/2, for one dimension
        density = (1 + (rates * unit * length) ** 2 / 3) ** -2.0
        mean = 1.0 if self.periodic else 0.5
        return density / (mean * np.sum(density))


def _numbers(values) -> tuple[Array, ...]:
    return tuple(jnp.asarray(value, dtype=float) for value in values)


class FreeFunction(Term):
    """A function of some family; which one, its arrays say.

    It is a sum of sines, or the form of that number (less one) in `PRIMITIVES`, whose
    numbers are then the first of its coefficients. All functions of one class are one
    compiled program.

    **Arguments:** `label` of the parameters; `coefficients` of the sines and of a
    jump; `rates`, `shifts` of the sines; `low`, `high` of the argument; `picks` and
    `factors`, weights of what may be the argument and the factor; `middle`, `slip`.
    """

    sentence: ClassVar[str] = "a function without a name"
    listed: ClassVar[bool] = False
    label: str = eqx.field(static=True)
    coefficients: tuple[Array, ...] = eqx.field(converter=_numbers)
    rates: Float[Array, " k"]
    shifts: Float[Array, " k"]
    low: Float[Array, ""]
    high: Float[Array, ""]
    picks: Float[Array, " a"]
    factors: Float[Array, " b"]
    middle: Float[Array, ""]
    slip: Float[Array, ""]
    jumping: Float[Array, ""]
    periodic: Bool[Array, ""]
    form: Int[Array, ""] = eqx.field(
        default=0, converter=lambda value: jnp.asarray(value, dtype=int)
    )
    table: Float[Array, " n"] | None = None

    def prepared(self):
        """The function as a cubic spline: no step has to work out its sines.

        A sine on equal knots is interpolated by B-splines whose coefficients are its
        values there over `(2 + cos(rate * spacing)) / 3`.
        """
        spacing = (self.high - self.low) / (_KNOTS - 3)
        knots = self.low + spacing * (jnp.arange(_KNOTS, dtype=float) - 1.0)
        each = (
            jnp.stack(self.coefficients[:-1]) * 3 / (2 + jnp.cos(self.rates * spacing))
        )
        table = jnp.sin(jnp.outer(knots, self.rates) + self.shifts[None]) @ each
        return eqx.tree_at(lambda f: f.table, self, table, is_leaf=lambda x: x is None)

    @classmethod
    def of(
        cls,
        family: Family,
        label: str,
        coefficients,
        primitive: Primitive | None = None,
    ):
        """A member of a family by the coefficients of its sines, then of its jump.

        With a `primitive`, the first of them are its numbers.
        """
        rates, shifts = family.waves(len(coefficients) - 1)

        def chosen(options, one):
            return jnp.array([float(option is one) for option in options])

        # a restitution sees the approach speed where a force sees the velocity
        argument = family.argument
        if argument is Variable.APPROACH:
            argument = Variable.VELOCITY

        return cls(
            label=label,
            coefficients=tuple(coefficients),
            rates=rates,
            shifts=shifts,
            low=jnp.asarray(family.low),
            high=jnp.asarray(family.high),
            picks=chosen(_ARGUMENTS, argument),
            factors=chosen(_FACTORS, family.factor),
            middle=jnp.asarray(family.middle),
            slip=jnp.asarray(family.slip),
            periodic=jnp.asarray(family.periodic),
            jumping=jnp.asarray(float(family.jumps)),
            motion_unit=family.motion_unit,
            form=0 if primitive is None else 1 + PRIMITIVES.index(primitive),
        )

    def place(self, argument, direction) -> Place:
        """What a form sees of an argument, and of the direction of the motion."""
        width = self.high - self.low
        share = (argument - self.low) / width
        return Place(argument, share, argument / width, direction)

    def at(self, argument, direction: Any = 0.0):
        """The function without its factor.

        **Arguments:** its argument, and the direction of the motion.
        """
        place = self.place(argument, direction)

        def sines():
            jump = self.jumping * self.coefficients[-1] * direction
            return self._sines(argument) + jump

        def of(one: Primitive):
            return lambda: one.function(place, self.coefficients) + jnp.zeros(())

        return jax.lax.switch(self.form, [sines, *map(of, PRIMITIVES)])

    def _sines(self, argument):
        """The sum of the sines, that of the ends beyond them."""
        if self.table is None:
            return self.prepared()._sines(argument)
        width = self.high - self.low
        along = argument - self.low
        along = jnp.where(self.periodic, along % width, jnp.clip(along, 0.0, width))
        place = along * ((_KNOTS - 3) / width)
        first = jnp.clip(jnp.floor(place), 0, _KNOTS - 4)
        u = place - first
        first = first.astype(int)
        weights = (
            (1 - u) ** 3 / 6,
            (3 * u**3 - 6 * u**2 + 4) / 6,
            (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6,
            u**3 / 6,
        )
        return sum(w * self.table[first + k] for k, w in enumerate(weights))

    def _argument(self, motion: Motion, speed):
        options = (motion.position, speed, motion.phase, motion.t)
        return sum(w * option for w, option in zip(self.picks, options))

    def numbers(self) -> tuple[Array, ...]:
        return self.coefficients

    def parameters(self, place: int) -> list[Parameter]:
        return [
            Parameter(
                f"{self.label}_{k}",
                lambda m, k=k: terms_of(m)[place].coefficients[k],  # pyright: ignore
                nominal=0.0,
                scale=1.0,
            )
            for k in range(len(self.coefficients))
        ]


class FreeForce(FreeFunction):
    """An acceleration."""

    name: ClassVar[str] = "free_force"

    def acceleration(self, motion: Motion):
        argument = self._argument(motion, motion.velocity)
        direction = jnp.tanh(motion.velocity / self.slip)
        deflection = motion.position - self.middle
        options = (1.0, motion.velocity, direction, deflection)
        factor = sum(w * option for w, option in zip(self.factors, options))
        return self.at(argument, direction) * factor


class FreeRestitution(FreeFunction):
    """A factor on the restitution coefficient, `exp` of the function."""

    name: ClassVar[str] = "free_restitution"

    def restitution(self, approach, motion: Motion):
        return jnp.exp(self.at(self._argument(motion, approach)))


class FreeSurface(FreeFunction):
    """How much higher the surface is."""

    name: ClassVar[str] = "free_surface"

    def contact(self, motion: Motion):
        return self.at(self._argument(motion, motion.velocity))


def free_basis(
    family: Family, at: Float[np.ndarray, " n"], count: int
) -> Float[np.ndarray, "n count"]:
    """What each coefficient of a function adds to it, without its factor."""
    rates, shifts = (np.asarray(x) for x in family.waves(count - 1))
    sines = np.sin(np.outer(at, rates) + shifts)
    jump = np.tanh(at / family.slip) if family.jumps else np.zeros(len(at))
    return np.column_stack([sines, jump])


FREE: dict[Where, type[FreeFunction]] = {
    Where.FLIGHT: FreeForce,
    Where.IMPACT: FreeRestitution,
    Where.CONTACT: FreeSurface,
}


def families(
    positions: tuple[float, float],
    velocities: tuple[float, float],
    approach: tuple[float, float],
    duration: float,
    *,
    turned: bool,
    impacting: bool,
    slip: float,
    motion_unit: str,
) -> tuple[Family, ...]:
    """All families over the ranges that some recordings visit.

    **Arguments:** least and largest position, velocity and approach speed, the length
    of the records (s), whether there is a drive with a phase and whether there are
    impacts, the slip speed, and the unit of the motion.
    """
    ranges = {
        Variable.POSITION: positions,
        Variable.VELOCITY: velocities,
        Variable.TIME: (0.0, duration),
        Variable.APPROACH: approach,
        Variable.PHASE: (0.0, 2 * math.pi),
    }

    def one(where: Where, argument: Variable, factor: Factor = Factor.ONE) -> Family:
        return Family(
            where,
            argument,
            *ranges[argument],
            factor,
            sum(positions) / 2,
            slip,
            motion_unit,
        )

    phase = (Variable.PHASE,) if turned else ()
    found = [
        one(Where.FLIGHT, argument, factor)
        for argument in (*_TIMELESS, Variable.TIME, *phase)
        for factor in Factor
        if (argument, factor) not in _DOUBLED
    ]
    if impacting:
        found += [
            one(Where.IMPACT, argument)
            for argument in (Variable.APPROACH, Variable.TIME, *phase)
        ]
        found += [one(Where.CONTACT, argument) for argument in (Variable.TIME, *phase)]
    return tuple(found)


_TIMELESS = (Variable.POSITION, Variable.VELOCITY)
# a function of the argument alone can do as much
_DOUBLED = {
    (Variable.POSITION, Factor.DEFLECTION),
    (Variable.VELOCITY, Factor.VELOCITY),
    (Variable.VELOCITY, Factor.DIRECTION),
}
