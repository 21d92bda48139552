"""Take one attempted step in the current mode, and repeat it in a loop.

A `LoopState` holds the state of a trajectory; `iteration` takes an attempted step and
returns its record.
"""

from ._advance import Plan as Plan
from ._frame import lift_and_remainder as lift_and_remainder
from ._functions import Functions as Functions
from ._gap_polynomial import Jet as Jet
from ._iterate import iteration as iteration
from ._jumps import jumping_components as jumping_components
from ._loop_state import (
    first_state as first_state,
    loop_state as loop_state,
    LoopState as LoopState,
)
from ._run import (
    attempts as attempts,
    Log as Log,
    log_of as log_of,
    numbers_of_row as numbers_of_row,
    rows_of_kind as rows_of_kind,
    run as run,
    run_many as run_many,
    run_reversible as run_reversible,
)
from ._scale import first_extents as first_extents
from ._select import select as select
from ._start import starts_behind as starts_behind
