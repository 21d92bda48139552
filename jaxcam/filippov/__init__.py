"""Filippov systems: two vector fields, and sliding on the surface between them."""

from ._simulate import simulate_filippov as simulate_filippov
from ._system import FilippovSystem as FilippovSystem
from ._trajectory import FilippovTrajectory as FilippovTrajectory
from .flows import filippov_flow as filippov_flow
from .modes import equivalent_control as equivalent_control
