"""Adapt programs to JAX's tracing and XLA's compiler: only the speed changes.

The only exception is `whole`, which adds missing transformations to a loop.
"""

from ._elements import split as split
from ._jaxprs import (
    opened as opened,
    saving_jvp as saving_jvp,
    used_inputs as used_inputs,
)
from ._known import (
    computed as computed,
    is_known as is_known,
    join_known as join_known,
)
from ._materialise import (
    depend_on as depend_on,
    with_kept as with_kept,
    without_library as without_library,
)
from ._motion_series import (
    motion_series as motion_series,
    MotionSeries as MotionSeries,
)
from ._moves import rearranged as rearranged
from ._one_kernel import one_kernel as one_kernel
from ._packing import pack as pack, Packed as Packed
from ._scalarise import joined as joined, scalarise as scalarise
from ._scalars import Memory as Memory
from ._scatter import (
    COMBINED as COMBINED,
    replaces as replaces,
    scattered as scattered,
)
from ._whole import has_program as has_program, while_loop as while_loop, whole as whole
