"""Test functions that a problem adds to the built-in ones."""

import equinox as eqx


class Monitor(eqx.Module):
    """A test function added by a problem, and the meaning of its zero.

    Examples:
        >>> import continuation
        >>> continuation.Monitor("grazing", ends=True).kind
        'grazing'
    """

    kind: str = eqx.field(static=True)
    """Name of the special point at its zero, such as `"grazing"`."""
    ends: bool = eqx.field(static=True, default=False)
    """Whether the branch of this problem ends at the zero. `AbstractProblem.transition`
    then returns another problem with which to continue, if there is one. If a step
    fails or its result is rejected, a zero of such a monitor is also searched for ahead
    of the last point. The monitor therefore need not exist or change sign beyond its
    zero, but it must have a nonzero slope on the near side.
    """
    bracket: bool = eqx.field(static=True, default=False)
    """Whether the zero is bracketed by points of the branch instead of computed by
    Newton's method; for monitors whose derivative is costly to compile.
    """
    corner: bool = eqx.field(static=True, default=False)
    """Whether the branch may have a corner at the zero, where it turns abruptly."""
    vanishing: tuple[str, ...] = eqx.field(static=True, default=())
    """Names of monitors that are also zero whenever this one is, and are then
    ignored.
    """
