"""Representations of an orbit with impacts."""

from typing import Any

import equinox as eqx
import numpy as np

from ..representation import AbstractRepresentation
from ._run_twice import away_from_half, rotations


class ImpactSequences(AbstractRepresentation):
    """The representations of an orbit with m impacts, which can start at any of them;
    m of the unknowns are impact times.
    """

    family: str = eqx.field(static=True)
    problem: Any
    """An `ImpactingOrbits`."""

    def copies(self, u, tangent):
        problem = self.problem
        hits, m = problem.constraints, len(problem.constraints)
        if not hits:
            return [(self.family, u, tangent)]
        states = rotations(problem, u)
        tangents = rotations(problem, tangent, rate=True)
        return [
            (problem.sequence(hits[k:] + hits[:k]), states[k], tangents[k])
            for k in range(m)
        ]

    def brought_near(self, states, u):
        problem = self.problem
        if not (problem.periods and problem.constraints):
            return states
        # all phases may be shifted by a whole number of forcing periods
        phases = np.zeros(u.size)
        phases[:: 1 + problem.dimension] = 1.0
        return states + np.round(u[0] - states[:, :1]) * phases

    def half_away(self, u, parameters):
        return away_from_half(self.problem, u, parameters)
