"""Products of two parametric forms, each of an argument of its own."""

from typing import NamedTuple

from ._families import Family
from ._parametric_form import Primitive
from ._primitives import MOST_NUMBERS


GATE_PLACES = tuple(range(MOST_NUMBERS, 2 * MOST_NUMBERS - 1))
"""Indices of the parameters of a second form among the coefficients of a function.

They follow the largest number of parameters that the first form can have.
"""


class Gate(NamedTuple):
    """The second form of a product, and the family whose argument it has.

    The first form contains the size of the product, so the size of the second is one.
    """

    family: Family
    primitive: Primitive

    @property
    def places(self) -> tuple[int, ...]:
        """Return the indices of its parameters among the coefficients of a function."""
        return GATE_PLACES[: self.primitive.count - 1]
