"""Free functions of one argument, times a factor, fitted with a Gaussian process prior.

A function is a sum of sines whose coefficients have the variances of a Gaussian process
with a Matern kernel (Solin and Sarkka, Statistics and Computing 2020, eq. 55-59), or of
harmonics of the drive's phase with the same spectrum. It is therefore linear in the
fitted coefficients, and a single number describes its smoothness.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ._families import Factor, Family
from ._fitted_function import FittedFunction
from ._free_splines import BEYOND, interpolated, knots_of, splines
from ._parametric_form import MOST_PARTS, Primitive
from ._primitives import PRIMITIVES
from ._products import Gate, GATE_PLACES
from ._shapes import Variable
from ._term import Motion, Term
from ._where import Where


_ARGUMENTS = (Variable.POSITION, Variable.VELOCITY, Variable.PHASE, Variable.TIME)
"""Arguments, in the order of the weights that select them."""
_FACTORS = (Factor.ONE, Factor.VELOCITY, Factor.DIRECTION, Factor.DEFLECTION)


def _array(values) -> Array:
    return jnp.asarray(values, dtype=float)


def _indices(form: Primitive | None) -> tuple[float, ...]:
    """Return the indices of the parts of a form, counted from one, or zeros."""
    parts = () if form is None else form.parts or (form,)
    found = [1.0 + PRIMITIVES.index(part) for part in parts]
    return (*found, *[0.0] * (MOST_PARTS - len(found)))


def _numbers(values) -> tuple[Array, ...]:
    return tuple(jnp.asarray(value, dtype=float) for value in values)


class FreeFunction(FittedFunction):
    """A function of any family, selected by the values of its arrays.

    It is a sum of sines if the first of `forms` is zero. Otherwise it is the sum of the
    forms that have these numbers in `PRIMITIVES`, counted from one, and the first
    coefficients are their parameters. All functions of one class share one compiled
    program. A function with a `gate` is a product of two forms, and has a program of
    its own.

    **Arguments:** `label` of the parameters; `coefficients` of the sines and of a jump;
    `rates`, `shifts` of the sines; `low`, `high` of the argument; `picks` and
    `factors`, weights that select the argument and the factor; `middle`, `slip`;
    `stride`, the change of the argument in an integration step, over which derivatives
    are averaged, or `None`; `sharp`, whether a fit smooths the edges of the form in
    derivatives only; `gate`, the second form of a product, whose parameters are among
    the `coefficients` of the first (see `Gate`).
    """

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
    forms: Float[Array, " m"] = eqx.field(default=(0.0,) * MOST_PARTS, converter=_array)
    odd: Float[Array, ""] = eqx.field(default=0.0, converter=_array)
    stride: Float[Array, ""] | None = None
    sharp: Float[Array, ""] = eqx.field(
        default=0.0, converter=_array, metadata={"spare": True}
    )
    # absent in saved systems without products
    gate: "FreeFunction | None" = eqx.field(default=None, metadata={"spare": True})
    table: Float[Array, " n"] | None = None
    softened: Float[Array, " n"] | None = None
    jump: Float[Array, ""] | None = None

    def prepared(self) -> "FreeFunction":
        """Return the function with a precomputed cubic spline, which is cheap to
        evaluate.

        A sine is interpolated at equidistant knots by B-splines whose coefficients are
        its values there divided by `(2 + cos(rate * spacing)) / 3`. The values of a
        form are used as coefficients directly, which smooths its edges over one knot.
        A second spline, of which only the derivatives are used, smooths jumps over an
        integration step: otherwise the derivative with respect to the place of an edge
        is zero in most steps, and much too large in the others.
        """
        (found,) = prepared_terms((self,))
        assert isinstance(found, FreeFunction)
        return found

    def _own_gate(self):
        """Return the second form of a product with its own parameters, or `None`."""
        if self.gate is None:
            return None
        count = len(self.coefficients)
        own = (jnp.ones(()), *(self.coefficients[k] for k in GATE_PLACES))
        own += (jnp.zeros(()),) * (count - len(own))
        return eqx.tree_at(lambda f: f.coefficients, self.gate, own)

    def exact(self):
        """Return the function with exact derivatives, not averaged over a step."""
        return eqx.tree_at(
            lambda f: (f.stride, f.softened, f.gate),
            self,
            (None, None, None if self.gate is None else self.gate.exact()),
            is_leaf=lambda x: x is None,
        )

    @classmethod
    def of(
        cls,
        family: Family,
        label: str,
        coefficients,
        primitive: Primitive | None = None,
        gate: Gate | None = None,
    ):
        """Return a member of a family with given coefficients of its sines and its
        jump.

        With a `primitive`, the first coefficients are its parameters; with a `gate`,
        some of the others are those of the second form of a product.
        """
        rates, shifts = family.waves(len(coefficients) - 1)

        return cls(
            label=label,
            coefficients=tuple(coefficients),
            rates=rates,
            shifts=shifts,
            low=jnp.asarray(family.low),
            high=jnp.asarray(family.high),
            picks=pick_of(family),
            factors=_chosen(_FACTORS, family.factor),
            middle=jnp.asarray(family.middle),
            slip=jnp.asarray(family.slip),
            stride=jnp.asarray(family.stride),
            periodic=jnp.asarray(family.periodic),
            jumping=jnp.asarray(float(family.jumps)),
            motion_unit=family.motion_unit,
            constraint=family.constraint,
            forms=_indices(primitive),
            odd=float(primitive is not None and primitive.odd),
            sharp=float(primitive is not None and family.has_sharp_edges(primitive)),
            gate=gate
            and cls.of(gate.family, label, [0.0] * len(coefficients), gate.primitive),
        )

    def at(self, argument, direction: Any = 0.0):
        """Return the function without its factor.

        A sum of sines is constant beyond the ends of its range. A form continues beyond
        them by a fraction of the range, because some velocities are outside the range.

        **Arguments:** the argument, and the direction of motion.
        """
        if self.table is None:
            return self.prepared().at(argument, direction)
        turned = 1 - self.odd + self.odd * direction
        return self._spline(argument) * turned + self.jump * direction

    def _spline(self, argument):
        """Return the value of the spline with the derivatives of the softened one.

        In a fit, a sharp form has two values, of which one is zero; with exact
        derivatives, it is smooth.
        """
        assert self.table is not None
        fixed = jax.lax.stop_gradient(argument)
        if self.softened is not None:
            argument = jnp.where(self.sharp > 0, fixed, argument)
        width = self.high - self.low
        start, spacing = knots_of(self.low, self.high)
        more = jnp.where(self.forms[0] > 0, BEYOND * width, 0.0)
        inside = argument - self.low
        within = jnp.clip(inside, -more, width + more)
        inside = jnp.where(self.periodic, inside % width, within)
        place = (inside + self.low - start) / spacing
        value, soft = interpolated((self.table, self.softened), place)
        if soft is None:
            return value
        size = jnp.abs(self.coefficients[0])
        on = jnp.abs(value) > size / 2
        edged = jnp.where(on, jnp.sign(value) * size, 0.0)
        value = jnp.where(self.sharp > 0, edged, value)
        return soft + jax.lax.stop_gradient(value - soft)

    def _argument(self, motion: Motion, speed):
        return picked(self.picks, motion, speed)


class FreeForce(FreeFunction):
    """A free function that, times its factor, is added to the acceleration."""

    name: ClassVar[str] = "free_force"

    def acceleration(self, motion: Motion):
        argument = self._argument(motion, motion.velocity)
        direction = jnp.tanh(motion.velocity / self.slip)
        deflection = motion.position - self.middle
        options = (1.0, motion.velocity, direction, deflection)
        factor = sum(w * option for w, option in zip(self.factors, options))
        if self.gate is not None:
            if self.gate.table is None:
                return self.prepared().acceleration(motion)
            across = self.gate._argument(motion, motion.velocity)
            factor = factor * self.gate.at(across, direction)
        return self.at(argument, direction) * factor


class FreeRestitution(FreeFunction):
    """A free function whose exponential multiplies the coefficient of restitution."""

    name: ClassVar[str] = "free_restitution"

    def restitution(self, approach, motion: Motion):
        return jnp.exp(self.at(self._argument(motion, approach)))


class FreeSurface(FreeFunction):
    """A free function added to the height of the surface."""

    name: ClassVar[str] = "free_surface"

    def contact(self, motion: Motion):
        return self.at(self._argument(motion, motion.velocity))


class FreeSensor(FreeFunction):
    """A free function added to the reading of the first coordinate's sensor."""

    name: ClassVar[str] = "free_sensor"

    def sensed(self, motion: Motion):
        return self.at(self._argument(motion, motion.velocity))


FREE: dict[Where, type[FreeFunction]] = {
    Where.FLIGHT: FreeForce,
    Where.IMPACT: FreeRestitution,
    Where.CONTACT: FreeSurface,
    Where.SENSOR: FreeSensor,
}


def pick_of(family: Family) -> Float[Array, " a"]:
    """Return the weights that select the argument of a family."""
    # the argument is the approach speed for a restitution, the velocity for a force
    argument = family.argument
    if argument is Variable.APPROACH:
        argument = Variable.VELOCITY
    return _chosen(_ARGUMENTS, argument)


def picked(picks: Float[Array, " a"], motion: Motion, speed):
    """Return the argument that weights select."""
    options = (motion.position, speed, motion.phase, motion.t)
    return sum(w * option for w, option in zip(picks, options))


def _chosen(options, one) -> Float[Array, " a"]:
    return jnp.array([float(option is one) for option in options])


def prepared_terms(terms: Sequence[Term]) -> tuple[Term, ...]:
    """Return terms with their splines precomputed, all in one loop, which is compiled
    once.
    """
    ready = [one if isinstance(one, FreeFunction) else one.prepared() for one in terms]
    places = [k for k, one in enumerate(ready) if isinstance(one, FreeFunction)]
    functions: list[Any] = [ready[k] for k in places]
    gates = [one._own_gate() for one in functions]
    every = [*functions, *(gate for gate in gates if gate is not None)]
    found = iter(_with_tables(every))
    functions = [next(found) for _ in functions]
    for k, one, gate in zip(places, functions, gates):
        inner = None if gate is None else next(found)
        ready[k] = eqx.tree_at(lambda f: f.gate, one, inner, is_leaf=_is_none)
    return tuple(ready)


def _with_tables(functions: Sequence[FreeFunction]) -> list[FreeFunction]:
    found: list[Any] = list(functions)
    for softened in (False, True):
        places = [
            k for k, f in enumerate(functions) if (f.stride is not None) is softened
        ]
        if not places:
            continue
        group = [functions[k] for k in places]
        most = max(len(f.coefficients) for f in group)
        rows = [_arguments(f, most) for f in group]
        stacked = jax.tree.map(lambda *parts: jnp.stack(parts), *rows)
        tables, jumps = jax.lax.map(lambda row: splines(*row), stacked)
        for n, k in enumerate(places):
            table, soft = (None if t is None else t[n] for t in tables)
            found[k] = eqx.tree_at(
                lambda f: (f.table, f.softened, f.jump),
                functions[k],
                (table, soft, jumps[n]),
                is_leaf=_is_none,
            )
    return found


def _arguments(function: FreeFunction, count: int):
    """Return the arguments of `splines`, with so many sines that the function has
    `count` coefficients; the last one is that of the jump.
    """
    *sines, jump = function.coefficients
    more = count - len(function.coefficients)
    waves = (jnp.pad(one, (0, more)) for one in (function.rates, function.shifts))
    return (
        jnp.stack([*sines, *[jnp.zeros(())] * more, jump]),
        function.forms,
        tuple(waves),
        (function.low, function.high),
        function.jumping,
        function.stride,
    )


def _is_none(leaf) -> bool:
    return leaf is None
