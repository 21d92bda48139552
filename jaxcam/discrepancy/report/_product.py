"""Products of two forms: tables, derivatives and formulas."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..search import Free
from ..terms import Family, FreeFunction, GATE_PLACES, Place, Primitive, PRIMITIVES
from ._curves import errors_of, graded
from ._formula import formula_of


# Step of finite differences, relative to a significant change of a parameter
_STEP = 1e-4


class _Factor(NamedTuple):
    """One of the two forms, and the range of its argument."""

    form: Primitive
    low: float
    high: float
    slip: float
    jumps: bool

    @classmethod
    def of(cls, family: Family, form: Primitive) -> "_Factor":
        return cls(form, family.low, family.high, family.slip, family.jumps)

    @classmethod
    def in_term(cls, term: FreeFunction) -> "_Factor":
        """Return the form of a function that is part of a system."""
        form = PRIMITIVES[int(term.forms[0]) - 1]
        ends = float(term.low), float(term.high), float(term.slip)
        return cls(form, *ends, bool(term.jumping))

    def even(self, points: int) -> Float[np.ndarray, " n"]:
        return np.linspace(self.low, self.high, points)

    def at(self, along, numbers) -> Float[np.ndarray, " n"]:
        direction = np.tanh(along / self.slip) if self.jumps else 0.0 * along
        place = Place.between(along, self.low, self.high)
        value = self.form.value(place, numbers, direction)
        return np.broadcast_to(value, along.shape)


def product_table(
    one: Free, numbers: np.ndarray, covariance: np.ndarray, points: int
) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray]:
    """Return a grid of both arguments, and value and standard error of a product there,
    each `(points, points)`.

    **Arguments:** the product, its parameters and their covariance, and the number of
    points of each argument.
    """
    assert one.gate is not None and one.primitive is not None
    first = _Factor.of(one.family, one.primitive)
    second = _Factor.of(one.gate.family, one.gate.primitive)
    count = one.primitive.count
    gate = np.append(1.0, numbers[count:])
    along = graded(first.even(points), lambda x: first.at(x, numbers[:count]))
    across = graded(second.even(points), lambda x: second.at(x, gate))
    values = _values(first, second, along, across)
    slopes = _slopes(values, numbers, np.abs(one.spread))
    error = errors_of(slopes.reshape(-1, len(numbers)), covariance)
    value = values(numbers)
    return (along, across), value, error.reshape(value.shape)


def product_slopes(term: FreeFunction, points: int) -> Float[np.ndarray, "k p"]:
    """Return the derivatives of a product with respect to its parameters, on a grid
    over both ranges with about the given number of points.
    """
    assert term.gate is not None
    first, second = _Factor.in_term(term), _Factor.in_term(term.gate)
    side, every = math.isqrt(points), [float(x) for x in term.coefficients]
    own = every[: first.form.count]
    more = [every[k] for k in GATE_PLACES[: second.form.count - 1]]
    scales = [abs(own[0]), *first.form.scales, *second.form.scales]
    values = _values(first, second, first.even(side), second.even(side))
    slopes = _slopes(values, np.array([*own, *more]), np.array(scales))
    return slopes.reshape(-1, slopes.shape[-1])


def product_of(one: Free, numbers: np.ndarray) -> tuple[str, str]:
    """Return the formula of a product, and a sentence about it."""
    assert one.gate is not None and one.primitive is not None
    count = one.primitive.count
    first, says = formula_of(one.family, one.primitive, numbers[:count], "force")
    own = np.append(1.0, numbers[count:])
    second, also = formula_of(one.gate.family, one.gate.primitive, own, "force")
    # both formulas begin with a coefficient, and the product has a single one
    (size, rest), (other, factor) = first.split("*", 1), second.split("*", 1)
    text = f"{float(size) * float(other):.4g}*{rest}*{factor}"
    acts, acts_too = (
        said.split(": ", 1)[0].removeprefix("a force that ") for said in (says, also)
    )
    return text, f"a force that {acts}, times a factor that {acts_too}: {text}"


def _values(
    first: _Factor, second: _Factor, along, across
) -> Callable[[np.ndarray], np.ndarray]:
    """Return a product on a grid `(n, m)` as a function of its parameters."""
    count = first.form.count

    def values(numbers):
        gate = np.append(1.0, numbers[count:])
        one, other = first.at(along, numbers[:count]), second.at(across, gate)
        return np.outer(one, other)

    return values


def _slopes(values, numbers, scales) -> Float[np.ndarray, "n m p"]:
    """Return central differences with respect to each parameter."""
    steps = _STEP * np.diag(scales)
    return np.stack(
        [
            (values(numbers + step) - values(numbers - step)) / (2 * step[k])
            for k, step in enumerate(steps)
        ],
        axis=-1,
    )
