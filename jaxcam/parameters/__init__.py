"""Select parameters of any pytree, and convert floats to arrays."""

from ._arrays import as_arrays as as_arrays
from ._pick import (
    parameter_names as parameter_names,
    Pick as Pick,
    pick as pick,
    unit_tangent as unit_tangent,
    Where as Where,
)
from ._real import real_array as real_array
from ._vectors import (
    AnyArray as AnyArray,
    FloatScalar as FloatScalar,
    RealScalar as RealScalar,
    VectorLike as VectorLike,
)
