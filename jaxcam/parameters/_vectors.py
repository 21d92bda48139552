"""Array types of user input and of results on the host."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Array, ArrayLike, Float, Real


AnyArray: TypeAlias = Array | np.ndarray
"""A JAX or NumPy array."""
RealScalar: TypeAlias = Real[ArrayLike, ""]
"""A real number or a scalar array."""
FloatScalar: TypeAlias = float | Float[AnyArray, ""]
"""A number or a scalar array, which may be an argument of a compiled program."""
VectorLike: TypeAlias = Float[ArrayLike, " _"] | Sequence[RealScalar]
"""A vector of any length, as an array or a list of numbers."""
