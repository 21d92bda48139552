"""Type aliases shared by the package."""

from typing import TypeAlias

from jaxtyping import Array, ArrayLike, Float, Real


RealScalar: TypeAlias = Real[ArrayLike, ""]
State: TypeAlias = Float[Array, " n"]
