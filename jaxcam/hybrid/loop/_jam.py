"""End a run where friction causes a contact force not to exist or not to be unique."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._advance import Plan
from ._functions import Functions
from ._loop_state import LoopState
from ._step import seen_from_inside, Step, StepEnd


# a compliance of the contacts up to this, relative to that without friction, counts as
# zero
_ZERO = 1e-9
# a step that is shorter than this fraction of the longest step is not repeated
_TINY = 1e-12


class Jam(NamedTuple):
    """The result of checking the compliance of the contacts in a step."""

    # whether the compliance has fallen to zero at the end of the step
    near: Any
    # whether the step ends well beyond that point, and a better length for it
    retake: Any
    length: Any


def jam_of_step(
    functions: Functions, plan: Plan, carried: LoopState, end: StepEnd, made: Step
) -> Jam:
    """Return whether the contacts lose their compliance in a step.

    The contact force may have a pole there, so a change of its sign is not a release.
    """
    h, no = end.length, jnp.asarray(False)
    if not functions.rubs:
        return Jam(no, no, jnp.full_like(h, jnp.inf))
    seen = seen_from_inside(plan, end)(end.t)
    least = functions.compliance(seen, made.x, carried.mode)
    near = least <= _ZERO
    beyond = least < -_ZERO
    retake = beyond & (h > _TINY * carried.longest) & ~carried.completing
    return Jam(near, retake, jnp.where(retake, 0.5 * h, jnp.inf))


def jams_after(functions: Functions, jam: Jam, good, begins, t, x, mode):
    """Return whether the motion cannot continue after the end of a `good` step.

    The new mode, which an event may have changed, is examined as well. If a chatter
    `begins` to be completed, there is no contact yet, so nothing is examined.
    """
    if not functions.rubs:
        return jnp.asarray(False)
    least = functions.compliance(t, x, mode)
    return good & ~begins & (jam.near | (least <= 0))
