"""The events of a trajectory, and the points between them."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from ...parameters import AnyArray


class Impacts(eqx.Module):
    """The impacts of a trajectory, in order.

    Under a transformation (`jit`, `vmap`, `grad`) the arrays keep a fixed length k; the
    first `count` entries are real, later times are inf and later states NaN. While a
    trajectory is assembled outside of transformations, they are NumPy arrays.
    """

    time: Float[AnyArray, " k"]
    """Time of each impact (s), shape `(k,)`."""
    before: Float[AnyArray, "k n"]
    """State just before each impact, shape `(k, n)`."""
    after: Float[AnyArray, "k n"]
    """State just after each impact, shape `(k, n)`."""
    constraint: Int[AnyArray, " k"]
    """Index of the constraint that was hit, shape `(k,)`."""
    speed_before: Float[AnyArray, " k"]
    """Normal velocity before the impact, negative, shape `(k,)`."""
    speed_after: Float[AnyArray, " k"]
    """Normal velocity after the impact, positive, shape `(k,)`."""
    count: Int[AnyArray | np.integer, ""]
    """Number of impacts."""


class Contacts(eqx.Module):
    """The intervals of sustained contact (sticking), in order; padded as `Impacts` is.

    A contact that lasts beyond the run has `released` False and ends where the run
    does.
    """

    start: Float[AnyArray, " m"]
    """Start of contact (s): the accumulation time of the chatter, or t0; shape `(m,)`.
    """
    end: Float[AnyArray, " m"]
    """Release time (s), shape `(m,)`."""
    released: Bool[AnyArray, " m"]
    """Whether the contact ended by release, shape `(m,)`."""
    constraint: Int[AnyArray, " m"]
    """Index of the constraint, shape `(m,)`."""
    count: Int[AnyArray | np.integer, ""]
    """Number of contacts."""


class Steps(eqx.Module):
    """The points between which the motion was integrated, with their modes."""

    time: Float[AnyArray, " s"]
    """Time of each point (s), shape `(s,)`."""
    state: Float[AnyArray, "s n"]
    """State at each point, shape `(s, n)`."""
    contact: Bool[AnyArray, "s constraints"]
    """Whether each constraint is in contact from this point on, shape
    `(s, constraints)`."""
    count: Int[AnyArray | np.integer, ""]
    """Number of points."""
