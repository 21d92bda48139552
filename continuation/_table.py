"""Print tables of points."""

import numpy as np
import rich.console
import rich.table

from ._point import Branch, Point


def table(
    branch: Branch,
    *,
    every: int = 0,
    components: int = 3,
    shown: tuple[str, float] | None = None,
) -> rich.table.Table:
    """Return a table of the special points, ends and some ordinary points of a branch.

    Args:
        branch: The branch.
        every: Show every ordinary point whose label is a multiple of this; 0 shows
            none.
        components: Number of state components to show.
        shown: Heading of the parameter column, and a factor for its values, such as
            `("speed (rpm)", 30 / math.pi)`.

    Returns:
        A table for `rich.print`.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> continuation.table(found).row_count
        3
    """
    found = rich.table.Table()
    names = branch.names or (branch.name,)
    factor = 1.0
    if shown is not None:
        names, factor = (shown[0], *names[1:]), shown[1]
    n = min(components, max((p.state.size for p in branch.points), default=0))
    heads = _heads(names, n)
    for head in heads:
        found.add_column(head, justify="right" if head != "type" else "left")
    for point in branch.points:
        if point.kind != "regular" or (every and point.label % every == 0):
            found.add_row(*_row(point, len(names), n, factor))
    return found


def _heads(names: tuple[str, ...], n: int) -> list[str]:
    return ["label", "type", *names, "|u|", *[f"u{i + 1}" for i in range(n)], "stable"]


def _row(point: Point, parameters: int, n: int, factor: float) -> list[str]:
    kind = "" if point.kind == "regular" else point.kind
    if not point.converged:
        kind += " (not converged)"
    stable = {True: "yes", False: "no", None: ""}[point.stable]
    first, *others = point.parameters[-parameters:] or (point.parameter,)
    values = (factor * first, *others)
    state = [f"{x:.6g}" for x in point.state[:n]]
    return [
        str(point.label),
        kind,
        *[f"{x:.9g}" for x in values],
        f"{np.linalg.norm(point.state):.6g}",
        *state,
        *[""] * (n - len(state)),
        stable,
    ]


class PointPrinter:
    """A callback that prints one line for each special point and each end.

    With `every`, ordinary points whose label is a multiple of it are also printed.

    Examples:
        >>> import continuation
        >>> from rich.console import Console
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> printer = continuation.PointPrinter(console=Console(quiet=True))
        >>> found = continuation.branch(
        ...     problem, [1.0], "a", (0.5, 2), callbacks=[printer]
        ... )
        >>> found.points[-1].kind
        'end'
    """

    def __init__(self, every: int = 0, console: rich.console.Console | None = None):
        self.every = every
        self.console = rich.console.Console() if console is None else console

    def __call__(self, point: Point) -> None:
        ordinary = point.kind == "regular"
        if ordinary and not (self.every and point.label % self.every == 0):
            return
        values = "  ".join(f"{x:.9g}" for x in point.parameters)
        words = point.reason or point.criticality
        self.console.print(
            f"{point.label:6d}  {point.kind:14s}  {values}  {words}".rstrip()
        )
