"""What a hybrid system is, and its exact trajectory."""

from ._chatter import (
    Completion as Completion,
    chatter_completion as chatter_completion,
    completion_time as completion_time,
)
from ._codes import RESULTS as RESULTS
from ._normal import (
    field_in_force as field_in_force,
    normal_acceleration as normal_acceleration,
    normal_directions as normal_directions,
    normal_velocity as normal_velocity,
    restitution_coefficients as restitution_coefficients,
    sticking_field as sticking_field,
)
from ._release_point import (
    ReleasePoint as ReleasePoint,
    contact_acceleration as contact_acceleration,
    contact_state as contact_state,
    release_point as release_point,
)
from ._settings import Settings as Settings
from ._simulate import simulate as simulate
from ._system import HybridSystem as HybridSystem
from ._trajectory import (
    Contacts as Contacts,
    Impacts as Impacts,
    Steps as Steps,
    Trajectory as Trajectory,
)
from ._stroboscope import Stroboscope as Stroboscope, stroboscope as stroboscope
