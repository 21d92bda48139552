"""Motion by steps of fixed length, events ignored: the other way to simulate."""

from ._lemke import lemke as lemke, Pivoting as Pivoting, solve_lcp as solve_lcp
from ._moreau import moreau as moreau, SteppedMotion as SteppedMotion
from ._relay import (
    is_p_matrix as is_p_matrix,
    relay_problem as relay_problem,
    RelaySystem as RelaySystem,
)
from ._relay_steps import relay_steps as relay_steps, RelayMotion as RelayMotion
