"""Simulate with fixed time steps, without event detection."""

from ._moreau import moreau as moreau, SteppedMotion as SteppedMotion
from ._relay_steps import relay_steps as relay_steps
from .relay import RelaySystem as RelaySystem
