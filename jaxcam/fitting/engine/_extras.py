"""Further arguments of the compiled programs of a fit."""

from typing import NamedTuple

from jaxtyping import Array, Float


class Sharpness(NamedTuple):
    """Standard errors of the joints of one recording, and of the state of a typical
    piece.

    Multiplied by the factor `apart`, the errors of the joints are so large that each
    piece is fitted separately.
    """

    flight: Float[Array, "k n"]
    impact: Float[Array, "k n"]
    gap: Float[Array, " k"]
    piece: Float[Array, "k n"]
    apart: Float[Array, ""]


class Extras(NamedTuple):
    """Further arguments of a compiled program: reference states in contact and the
    errors of the joints.

    `weight` `(r, k)` and `rest_weight` `(r, kc)` are the weights of the data of each
    piece.
    """

    guess: Float[Array, "r kc n"]
    sharpness: Sharpness
    weight: Float[Array, "r k"]
    rest_weight: Float[Array, "r kc"]
