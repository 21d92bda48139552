"""Type aliases shared by the package."""

from typing import TypeAlias

from jaxtyping import Array, Float

from ..parameters import RealScalar as RealScalar


State: TypeAlias = Float[Array, " n"]
