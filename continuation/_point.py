"""Points and branches."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from jaxcam.tables import ShortTable

from ._parameter import with_leaf
from .problem import AbstractProblem


ORDINARY = ("start", "regular", "end")
"""Kinds of points that are not special."""


@dataclass(frozen=True, eq=False, repr=False)
class Point:
    """A point of a branch; all arrays are NumPy arrays.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> found.at(1).stable
        True
    """

    label: int
    """Number of the point along the branch, from 1."""
    kind: str
    """`"start"`, `"regular"`, `"end"`, or the kind of special point."""
    parameter: float
    """Value of the continuation parameter."""
    state: np.ndarray
    """The solution, shape `(n,)`."""
    multipliers: np.ndarray
    """Eigenvalues of an equilibrium, or multipliers of a map or an orbit, shape `(k,)`.
    """
    stable: bool | None
    """Whether the solution is stable; None at special points, where stability is about
    to change, and if stability is not computed or a multiplier is not finite.
    """
    tangent: np.ndarray
    """Direction of the branch in (state, parameter), shape `(n+1,)`."""
    scale: np.ndarray
    """Scales used to measure lengths at this point, shape `(n+1,)`."""
    step: float
    """Length of the next step; 0 at a point between two special points."""
    arclength: float
    """Arclength from the start."""
    iterations: int
    """Number of corrector iterations."""
    converged: bool
    """Whether the corrector converged; False for a special point that could only be
    bracketed.
    """
    reason: str = ""
    """Reason for the end of the branch, or a remark on a special point."""
    coefficient: float | None = None
    """Normal-form coefficient, if there is one."""
    criticality: str = ""
    """The meaning of the sign of the coefficient, such as "supercritical"."""
    observed: dict[str, Any] = field(default_factory=dict)
    """Quantities that the problem records with each point."""
    tests: dict[str, float] = field(default_factory=dict)
    """Values of the test functions."""
    signature: str = ""
    """`problem.signature` at this point."""
    parameters: tuple[float, ...] = ()
    """Values of the continuation parameters, in order: one, or two on a curve of
    special points."""
    problem: AbstractProblem | None = None
    """The problem with its parameters at this point; None for a point read from a
    file.
    """
    leaf: int = -1
    """Index of the parameter among the leaves of the problem's parameters."""

    def __repr__(self) -> str:
        values = self.parameters or (self.parameter,)
        at = ", ".join(f"{value:.9g}" for value in values)
        words = [] if self.stable is None else [stability(self.stable)]
        words += [] if self.converged else ["not converged"]
        words += [one for one in (self.criticality, self.reason) if one]
        return f"Point {self.label}: {', '.join([f'{self.kind} at {at}', *words])}"

    @property
    def special(self) -> bool:
        """Return whether this is a special point."""
        return self.kind not in ORDINARY

    @property
    def solved(self) -> AbstractProblem:
        """Return the problem of this point; raise `ValueError` if it was read from a
        file without one.
        """
        if self.problem is None:
            raise ValueError(
                "the continuation problem was not read with this point; use "
                "load_branch(path, problem)"
            )
        return self.problem

    def inner(self, base: AbstractProblem, leaf: int) -> "Point":
        """Return this point of an extended problem as a point of the original problem.

        Args:
            base: The problem that was extended.
            leaf: Index of the parameter among the leaves.

        Returns:
            A `Point`.
        """
        value = float(self.state[-1])
        parameters = with_leaf(self.solved.parameters, leaf, np.asarray(value))
        return replace(
            self,
            state=self.state[:-1],
            parameter=value,
            problem=set_parameters(base, parameters),
        )


def replace(point: Point, **changes: Any) -> Point:
    """Return the same point with some fields changed."""
    return Point(**{**point.__dict__, **changes})


def stability(stable: bool | None) -> str:
    """Return stability as a word; empty if it is not computed."""
    return {True: "stable", False: "unstable", None: ""}[stable]


@dataclass(frozen=True, eq=False, repr=False)
class Branch:
    """A branch of solutions: its points in order.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> round(found.of_kind("fold")[0].parameter, 6) + 0.0
        0.0
    """

    points: tuple[Point, ...]
    """All points, including special ones."""
    name: str
    """Name of the parameter."""
    bounds: tuple[float, float]
    """(lowest, highest) value of the parameter."""
    leaf: int = 0
    """Index of the parameter among the leaves."""
    names: tuple[str, ...] = ()
    """Names of all parameters that vary."""

    def __repr__(self) -> str:
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> ShortTable:
        """Return a table of the ends and the special points."""
        names = self.names or (self.name,)
        count = f"{len(self.points)} points, {len(self.special)} of them special"
        sentence = f"Branch in {' and '.join(names)}: {count}."
        rows = []
        for point in self.points:
            if point.kind != "regular":
                values = point.parameters[-len(names) :] or (point.parameter,)
                kind = point.kind + ("" if point.converged else " (not converged)")
                notes = point.criticality or point.reason
                at = [f"{value:.9g}" for value in values]
                rows.append(
                    (str(point.label), kind, *at, stability(point.stable), notes)
                )
        headings = ("label", "kind", *names, "stability", "notes")
        return ShortTable(sentence, headings, rows, ("kind", "stability", "notes"))

    @property
    def special(self) -> tuple[Point, ...]:
        """The special points."""
        return tuple(point for point in self.points if point.special)

    @property
    def regular(self) -> tuple[Point, ...]:
        """The points that are not special."""
        return tuple(point for point in self.points if not point.special)

    def of_kind(self, kind: str) -> tuple[Point, ...]:
        """Return the special points of one kind.

        Args:
            kind: The kind, such as "fold" or "flip".

        Returns:
            A tuple of points.
        """
        return tuple(point for point in self.points if point.kind == kind)

    @property
    def reason(self) -> str:
        """The reason the branch ends."""
        return self.points[-1].reason if self.points else ""

    @property
    def parameters(self) -> np.ndarray:
        """Values of the parameter at all points."""
        return np.array([point.parameter for point in self.points])

    @property
    def states(self) -> np.ndarray:
        """States at all points, shape `(points, n)`, if n is the same along the whole
        branch.
        """
        return np.stack([point.state for point in self.points])

    def at(self, label: int) -> Point:
        """Return the point with a label.

        Args:
            label: Number of the point along the branch, from 1.

        Returns:
            A [`continuation.Point`][].

        Raises:
            ValueError: There is no such point.
        """
        for point in self.points:
            if point.label == label:
                return point
        raise ValueError(
            f"there is no point with label {label}; labels run from "
            f"{self.points[0].label} to {self.points[-1].label}"
        )


def relabelled(points: Sequence[Point]) -> tuple[Point, ...]:
    """Return the same points, numbered from 1."""
    return tuple(replace(point, label=i + 1) for i, point in enumerate(points))


def with_parameter(problem: Any, leaf: int, value: Any) -> Any:
    """Return the problem at another value of the parameter."""
    parameters = with_leaf(problem.parameters, leaf, np.asarray(value, float))
    return set_parameters(problem, parameters)


def set_parameters(problem: Any, parameters: Any) -> Any:
    """Return the problem with other parameters, wherever they are stored inside it."""
    names = {f.name for f in fields(problem)}
    if "parameters" in names:
        return with_field(problem, "parameters", parameters)
    base = getattr(problem, "base")
    return with_field(problem, "base", set_parameters(base, parameters))


def with_field(module: Any, name: str, value: Any) -> Any:
    """Return a module with one field replaced, as `equinox.tree_at` does, but ten times
    faster.
    """
    new = object.__new__(type(module))
    for f in fields(module):
        if f.name == name:
            object.__setattr__(new, name, value)
        elif hasattr(module, f.name):
            object.__setattr__(new, f.name, getattr(module, f.name))
    return new
