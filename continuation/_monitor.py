"""The test functions that a problem adds to those of the core."""

import equinox as eqx


class Monitor(eqx.Module):
    """A test function that a problem adds, and the meaning of its zero.

    Examples:
        >>> import continuation
        >>> continuation.Monitor("grazing", ends=True).kind
        'grazing'
    """

    kind: str = eqx.field(static=True)
    """Name of the special point at its zero, such as `"grazing"`."""
    ends: bool = eqx.field(static=True, default=False)
    """Whether the branch of this problem ends there. `AbstractProblem.transition` is
    then asked for another problem with which to continue. The zero of such a monitor is
    also sought ahead of the last point, when a step fails or its result is rejected; so
    the monitor may cease to exist, or not change sign, beyond its zero. It must have a
    nonzero slope on the near side."""
    bracket: bool = eqx.field(static=True, default=False)
    """Whether its zero is enclosed by points of the branch instead of solved for by
    Newton's method; for values whose derivative is costly to compile."""
    vanishing: tuple[str, ...] = eqx.field(static=True, default=())
    """Names of monitors that are zero wherever this one is, and are ignored there."""
