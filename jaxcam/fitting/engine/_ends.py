"""The states at the ends of all pieces of a recording."""

import jax
from jaxtyping import Array, Float

from ._fly import end_of_flight
from ._model import Model
from ._pieces import Pieces


def ends_of(model: Model, pieces: Pieces, states, substeps) -> Float[Array, "k s"]:
    """Return the states at the ends of the pieces of one recording.

    **Arguments:** the states at the beginnings, `(k, s)`; `substeps` may be traced.
    """

    def end(state, start, step, drive, discrete):
        return end_of_flight(model, state, start, step, drive, substeps, discrete)

    part = pieces.flown
    given = states, part.start, part.step, pieces.drive, pieces.begins
    return jax.vmap(end)(*given)
