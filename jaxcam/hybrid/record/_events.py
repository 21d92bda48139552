"""The events of a trajectory, and the points between them."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from ...parameters import AnyArray


class Impacts(eqx.Module):
    """The impacts of a trajectory, in order.

    Under a transformation (`jit`, `vmap`, `grad`) the arrays keep a fixed length k; the
    first `count` entries are real, later times are inf and later states NaN. While a
    trajectory is put together outside of one, they are NumPy's.
    """

    #: (k,) s
    time: Float[AnyArray, " k"]
    #: (k, n) state just before and just after
    before: Float[AnyArray, "k n"]
    after: Float[AnyArray, "k n"]
    #: (k,) which constraint was hit
    constraint: Int[AnyArray, " k"]
    #: (k,) normal velocity before (negative) and after (positive)
    speed_before: Float[AnyArray, " k"]
    speed_after: Float[AnyArray, " k"]
    count: Int[AnyArray | np.integer, ""]


class Contacts(eqx.Module):
    """The intervals of sticking, in order of their start; padded as `Impacts` is.

    `start` is the accumulation time of the chatter (or t0), `end` the release; a
    contact that lasts beyond the run has `released` False and ends where the run does.
    """

    start: Float[AnyArray, " m"]
    end: Float[AnyArray, " m"]
    released: Bool[AnyArray, " m"]
    constraint: Int[AnyArray, " m"]
    count: Int[AnyArray | np.integer, ""]


class Steps(eqx.Module):
    """The points between which the motion was integrated, with their modes."""

    time: Float[AnyArray, " s"]
    state: Float[AnyArray, "s n"]
    #: (s, constraints) whether the constraint is in contact from here on
    contact: Bool[AnyArray, "s constraints"]
    count: Int[AnyArray | np.integer, ""]
