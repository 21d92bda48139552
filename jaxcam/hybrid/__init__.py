"""What a hybrid system is, and its exact trajectory."""

from ._chatter import (
    chatter_completion as chatter_completion,
    Completion as Completion,
    completion_time as completion_time,
)
from ._codes import RESULTS as RESULTS
from ._events import Contacts as Contacts, Impacts as Impacts, Steps as Steps
from ._flow import Arrival as Arrival, flow as flow
from ._normal import (
    field_in_force as field_in_force,
    normal_acceleration as normal_acceleration,
    normal_directions as normal_directions,
    normal_velocity as normal_velocity,
    restitution_coefficients as restitution_coefficients,
    sticking_field as sticking_field,
)
from ._release_point import (
    contact_acceleration as contact_acceleration,
    contact_state as contact_state,
    release_point as release_point,
    ReleasePoint as ReleasePoint,
)
from ._settings import Settings as Settings
from ._simulate import simulate as simulate
from ._stroboscope import Stroboscope as Stroboscope, stroboscope as stroboscope
from ._system import HybridSystem as HybridSystem
from ._trajectory import Trajectory as Trajectory
