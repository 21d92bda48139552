"""Motion relative to the constraints: gaps, contact, chatter and release.

Everything is derived from the three functions that define a system.
"""

from ._chatter import (
    chatter_completion as chatter_completion,
    Completion as Completion,
    completion_coefficients as completion_coefficients,
    completion_time as completion_time,
)
from ._compliance import least_compliance as least_compliance
from ._contact_forces import (
    contact_multipliers as contact_multipliers,
    Distances as Distances,
    field_and_distances as field_and_distances,
    field_in_force as field_in_force,
    sticking_field as sticking_field,
)
from ._contact_friction import has_friction as has_friction
from ._first_contacts import pressed_accelerations as pressed_accelerations
from ._impact_law import (
    check_restitution as check_restitution,
    restitutions as restitutions,
)
from ._impacts import (
    impacts as impacts,
    restitution_coefficients as restitution_coefficients,
)
from ._impacts_together import (
    impacts_together as impacts_together,
    may_hit_together as may_hit_together,
    ONE_DIRECTION as ONE_DIRECTION,
)
from ._joint_rest import (
    joint_rest as joint_rest,
    LOSSY_RATIO as LOSSY_RATIO,
    SHORT_FLIGHT as SHORT_FLIGHT,
    SLOW_REBOUND as SLOW_REBOUND,
)
from ._masked import FEW as FEW, solve_masked as solve_masked
from ._normal import (
    along_path as along_path,
    free_jet as free_jet,
    gaps as gaps,
    lie_derivative as lie_derivative,
    lie_series as lie_series,
    motion_rates as motion_rates,
    normal_acceleration as normal_acceleration,
    normal_directions as normal_directions,
    normal_velocity as normal_velocity,
)
from ._onto_contacts import onto_contacts as onto_contacts
from ._release_point import (
    contact_acceleration as contact_acceleration,
    contact_state as contact_state,
    release_point as release_point,
    ReleasePoint as ReleasePoint,
)
from ._rest_state import rest_state as rest_state
from ._rounding import (
    forced_time as forced_time,
    gap_rounding as gap_rounding,
    least_gaps as least_gaps,
    speed_rounding as speed_rounding,
    start_room as start_room,
)
from ._slide_terms import InMode as InMode, Jumps as Jumps
from ._sliding import (
    beyond_shares as beyond_shares,
    field_and_distances_in_mode as field_and_distances_in_mode,
    field_in_mode as field_in_mode,
    heights_rounded as heights_rounded,
    hold_of as hold_of,
    open_distances as open_distances,
    open_surfaces as open_surfaces,
    settled as settled,
    slack_of_hold as slack_of_hold,
    switched_rounding as switched_rounding,
    switching_distances as switching_distances,
)
from ._switches import (
    OnSides as OnSides,
    resets as resets,
    surfaces as surfaces,
)
