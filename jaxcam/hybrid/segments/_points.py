"""Results of the compiled functions of `_motion.py`."""

from typing import NamedTuple

import jax


class PathPoint(NamedTuple):
    """An intermediate state, and for each constraint the distance from its event.

    The level is the gap of an open constraint, and the pressure (minus the multiplier)
    of a constraint in contact; at the event, the level falls through zero.
    """

    state: jax.Array
    level: jax.Array
    rate: jax.Array


class Hop(NamedTuple):
    """End of a short flight: a `PathPoint`, the normal velocities, the changes in
    height, and the error relative to the allowed error.
    """

    state: jax.Array
    level: jax.Array
    rate: jax.Array
    velocity: jax.Array
    climbed: jax.Array
    effort: jax.Array


class ChatterEnd(NamedTuple):
    """The end of a chatter sequence, and whether the series for it is valid."""

    possible: jax.Array
    duration: jax.Array
    state: jax.Array
