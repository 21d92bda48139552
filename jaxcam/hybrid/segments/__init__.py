"""Simulate by one call of `diffrax.diffeqsolve` per piece of motion (second engine)."""

from ._one_step import one_step as one_step
from ._pieces import simulate_segments as simulate_segments
