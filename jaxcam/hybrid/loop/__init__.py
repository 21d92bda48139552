"""One attempt at a step of whatever mode is in force, and the loop that repeats it.

A `LoopState` is what a trajectory carries; `iterate` makes an attempt and says what it
was.
"""

from ._advance import Plan as Plan
from ._functions import Functions as Functions
from ._gap_polynomial import Jet as Jet
from ._iterate import iterate as iterate
from ._loop_state import first_state as first_state, LoopState as LoopState
from ._run import (
    attempts as attempts,
    kinds as kinds,
    Log as Log,
    run as run,
    run_many as run_many,
    run_raw as run_raw,
    run_reversible as run_reversible,
)
from ._scale import first_extents as first_extents
from ._start import starts_behind as starts_behind
