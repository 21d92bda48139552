"""Filippov systems: two vector fields, and sliding on the surface between them."""

from ._system import FilippovSystem as FilippovSystem
from .modes import equivalent_control as equivalent_control
