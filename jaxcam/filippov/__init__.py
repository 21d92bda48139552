"""Filippov systems: two vector fields, and sliding on the surface between them."""

from ._modes import (
    equivalent_control as equivalent_control,
    Mode as Mode,
    mode_field as mode_field,
    region as region,
    sliding_field as sliding_field,
    surface_rates as surface_rates,
)
from ._run import filippov_flow as filippov_flow, leg_flow as leg_flow
from ._simulate import simulate_filippov as simulate_filippov
from ._system import FilippovSystem as FilippovSystem
from ._trajectory import (
    FilippovTrajectory as FilippovTrajectory,
    Switches as Switches,
)
