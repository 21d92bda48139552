"""Print tables of points."""

from collections.abc import Callable, Mapping

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
    columns: Mapping[str, Callable[[Point], complex | None]] | None = None,
) -> rich.table.Table:
    """Return a table of the special points, ends and some ordinary points of a branch.

    Args:
        branch: The branch.
        every: Show every ordinary point whose label is a multiple of this number; 0
            shows none.
        components: Number of state components to show.
        shown: Heading of the parameter column, and a factor for its values, such as
            `("speed (rpm)", 30 / math.pi)`.
        columns: Heading, and function of a point, of each column that is shown in place
            of the norm and the components of the state.

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
    if columns is None:
        columns = _components(branch, components)
    heads = ("label", "type", *names, *columns, "stable")
    rows = [
        _row(point, len(names), columns, factor)
        for point in branch.points
        if point.kind != "regular" or (every and point.label % every == 0)
    ]
    for k, head in enumerate(heads):
        cells = [row[k] for row in rows]
        # a long heading or name may be wrapped, but a number must not be
        words = head == "type"
        parts = [part for cell in cells for part in (cell.split() if words else [cell])]
        found.add_column(
            head,
            justify="left" if words else "right",
            min_width=max(map(len, parts), default=0),
            overflow="fold",
        )
    for row in rows:
        found.add_row(*row)
    return found


def _components(
    branch: Branch, most: int
) -> dict[str, Callable[[Point], complex | None]]:
    """Return the columns of the norm and the first components of the state."""
    n = min(most, max((p.state.size for p in branch.points), default=0))

    def component(k: int) -> Callable[[Point], complex | None]:
        return lambda p: float(p.state[k]) if k < p.state.size else None

    norm = {"|u|": lambda p: float(np.linalg.norm(p.state))}
    return norm | {f"u{k + 1}": component(k) for k in range(n)}


def _row(point: Point, parameters: int, columns, factor: float) -> list[str]:
    kind = "" if point.kind == "regular" else point.kind
    if not point.converged:
        kind += " (not converged)"
    stable = {True: "yes", False: "no", None: ""}[point.stable]
    first, *others = point.parameters[-parameters:] or (point.parameter,)
    values = (factor * first, *others)
    shown = [column(point) for column in columns.values()]
    return [
        str(point.label),
        kind,
        *[f"{x:.9g}" for x in values],
        *["" if x is None else f"{x:.6g}" for x in shown],
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
