"""Second engine: simulate with one `diffrax.diffeqsolve` call per piece of motion."""

from ._one_step import one_step as one_step
from ._pieces import simulate_segments as simulate_segments
