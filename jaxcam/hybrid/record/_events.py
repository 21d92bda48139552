"""The events of a trajectory, and the points between them."""

import equinox as eqx
from jaxtyping import Array, Bool, Float, Int


class Impacts(eqx.Module):
    """The impacts of a trajectory, in order.

    Under a transformation (`jit`, `vmap`, `grad`) the arrays keep a fixed length k; the
    first `count` entries are real, later times are inf and later states NaN.
    """

    #: (k,) s
    time: Float[Array, " k"]
    #: (k, n) state just before and just after
    before: Float[Array, "k n"]
    after: Float[Array, "k n"]
    #: (k,) which constraint was hit
    constraint: Int[Array, " k"]
    #: (k,) normal velocity before (negative) and after (positive)
    speed_before: Float[Array, " k"]
    speed_after: Float[Array, " k"]
    count: Int[Array, ""]


class Contacts(eqx.Module):
    """The intervals of sticking, in order of their start; padded as `Impacts` is.

    `start` is the accumulation time of the chatter (or t0), `end` the release; a
    contact that lasts beyond the run has `released` False and ends where the run does.
    """

    start: Float[Array, " m"]
    end: Float[Array, " m"]
    released: Bool[Array, " m"]
    constraint: Int[Array, " m"]
    count: Int[Array, ""]


class Steps(eqx.Module):
    """The points between which the motion was integrated, with their modes."""

    time: Float[Array, " s"]
    state: Float[Array, "s n"]
    #: (s, constraints) whether the constraint is in contact from here on
    contact: Bool[Array, "s constraints"]
    count: Int[Array, ""]
