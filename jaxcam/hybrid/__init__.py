"""What a hybrid system is, and its exact trajectory."""

from ._flow import Arrival as Arrival, flow as flow
from ._settings import Settings as Settings
from ._simulate import simulate as simulate
from ._sizes import component_sizes as component_sizes
from ._stroboscope import Stroboscope as Stroboscope, stroboscope as stroboscope
from ._system import HybridSystem as HybridSystem
from .codes import RESULTS as RESULTS
from .record import (
    Contacts as Contacts,
    Impacts as Impacts,
    Steps as Steps,
    Trajectory as Trajectory,
)
from .surface import (
    contact_state as contact_state,
    normal_acceleration as normal_acceleration,
    normal_velocity as normal_velocity,
    release_point as release_point,
)
