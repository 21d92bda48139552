"""Array types of input from outside and of results on the host."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Array, ArrayLike, Float, Real


AnyArray: TypeAlias = Array | np.ndarray
"""An array of a program, or of the host."""
RealScalar: TypeAlias = Real[ArrayLike, ""]
FloatScalar: TypeAlias = float | Float[AnyArray, ""]
"""A number that may be an argument of a program."""
VectorLike: TypeAlias = Float[ArrayLike, " _"] | Sequence[RealScalar]
"""One vector of any length, as an array or as a list of numbers."""
