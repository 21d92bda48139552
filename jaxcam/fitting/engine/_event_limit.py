"""Find pieces with more switching events than a fit locates."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ...hybrid import SwitchedSystem
from ...hybrid.programs import program
from ._layout import Layout
from ._linearise import Point, with_begins
from ._pieces import Pieces
from ._problem import Problem
from ._switched_steps import has_more_events


def crowded_pieces(problem: Problem, point: Point) -> Bool[np.ndarray, "r k"]:
    """Return which pieces have more events than are located, so that the fit ignores
    the later ones.

    Args:
        problem: The problem.
        point: Parameters, and states at the beginning of each piece.

    Returns:
        Shape `(r, k)`; false everywhere if the system has no switching surfaces.
    """
    exists = np.asarray(problem.pieces.exists)
    if not isinstance(problem.model.system, SwitchedSystem):
        return np.zeros(exists.shape, dtype=bool)
    return exists & np.asarray(_crowded(problem.layout, problem.pieces, point))


@program
def _crowded(layout: Layout, pieces: Pieces, point: Point):
    substeps = jnp.max(pieces.substeps)

    def record(values, states, pieces):
        model, part = layout.at(values), pieces.flown

        def crowded(state, start, step, drive, begin):
            given = model, state, start, step, drive
            return has_more_events(*given, substeps, begin)

        inputs = states, part.start, part.step, pieces.drive, pieces.begins
        return jax.vmap(crowded)(*inputs)

    return jax.vmap(record)(point.values, point.states, with_begins(pieces, point))
