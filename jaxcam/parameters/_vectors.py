"""What numbers are where they come from outside, or go from programs to the host."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Array, ArrayLike, Float, Real


#: of a program, or of the host
AnyArray: TypeAlias = Array | np.ndarray
RealScalar: TypeAlias = Real[ArrayLike, ""]
#: a number that may be an argument of a program
FloatScalar: TypeAlias = float | Float[AnyArray, ""]
#: one vector of any length, as an array or as a list of numbers
VectorLike: TypeAlias = Float[ArrayLike, " _"] | Sequence[RealScalar]
