"""Compare both halves of an orbit that is computed by single shooting."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import flow

from .._parameter import as_jax
from ..representation import Unique


class WithHalves(Unique):
    """The representation of the orbits of a `SingleShooting`, whose halves are compared
    by a simulation.
    """

    problem: Any = eqx.field(kw_only=True)

    def half_away(self, u, parameters):
        problem = self.problem
        if problem.periods % 2:
            return None
        system, u = as_jax(parameters), jnp.asarray(u)
        start, end = problem.times(u, system)
        state = problem.start(u, system)
        half = flow(system, state, start, (start + end) / 2, settings=problem.settings)
        if int(half.code):
            return None
        scale = np.asarray(problem.scale(u, system))[: len(state)]
        return float(np.linalg.norm(np.asarray(half.state - state) / scale))
