"""Hidden elements in a problem: their kind, parameters and signals."""

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...fitting import Model, Problem
from ...fitting.engine import Point
from ..terms import (
    DIRECT,
    HiddenElement,
    HiddenForce,
    SHARED,
    STARTS,
    terms_of,
    Where,
)
from ._hidden_kinds import Kind
from ._hidden_signals import Driven


# Step of the parameters of an element, for the derivatives of its force
_STEP = 1e-3
# Largest expected force of a free motion, in multiples of the rms force
_LARGEST_START = 5.0


@dataclasses.dataclass(frozen=True, eq=False)
class Hidden:
    """A fitted hidden element, linearised about its parameters.

    - `numbers`, `strengths`, `starts` `(r, s)`: values about which its force is
      linearised.
    - `direct`: the direct parts of the force that are fitted.
    - `cells`: number of grid cells in the scan that found it.
    """

    kind: Kind
    driven: Driven
    numbers: tuple[float, ...]
    strengths: tuple[float, ...]
    starts: Float[np.ndarray, "r s"]
    direct: tuple[int, ...] = tuple(range(DIRECT))
    cells: int = 1
    slot: str = HiddenForce.label

    # an element has no smoothness prior
    smooth: ClassVar[bool] = False

    @property
    def label(self) -> str:
        return f"hidden {self.kind.name}"

    @property
    def where(self) -> Where:
        return Where.FLIGHT

    @property
    def outputs(self) -> list[str]:
        """Return the names of the fitted strengths of the element's outputs."""
        return [f"{self.slot}_shared_{k}" for k in range(len(self.kind.outputs))]

    @property
    def changes(self) -> list[str]:
        """Return the names of the fitted changes of the element's parameters."""
        first = len(self.kind.outputs)
        return [
            f"{self.slot}_shared_{first + k}" for k in range(len(self.kind.numbers))
        ]

    @property
    def free_motions(self) -> list[str]:
        return [f"{self.slot}_starts_{k}" for k in range(self.kind.starts)]

    @property
    def direct_parts(self) -> list[str]:
        return [f"{self.slot}_direct_{k}" for k in self.direct]

    @property
    def coefficients(self) -> list[str]:
        """Return the names of all parameters of the element in the fit."""
        return [
            *self.outputs,
            *self.changes,
            *self.free_motions,
            *self.direct_parts,
        ]

    def price(self, samples: int) -> float:
        """Return the gain that the parameters of the element and the scan require."""
        shared = len(self.outputs) + len(self.changes) + len(self.direct)
        count = shared + self.starts.size
        return count * math.log(samples) + 2 * math.log(self.cells)

    def moved_from(self, other: "Hidden") -> float:
        """Return the distance between the parameters of two elements, in units of the
        largest changes allowed in one fit.
        """
        return max(
            abs(number.change(a, b)) / self.kind.reach(number, other.numbers)
            for number, a, b in zip(self.kind.numbers, other.numbers, self.numbers)
        )

    def force(self, numbers: Sequence[float]) -> Float[np.ndarray, "r n"]:
        """Return the force of the element for other parameters but equal strengths."""
        ((outputs, free),) = self.kind.signals(self.driven, [numbers])
        return self._sum(outputs, free)

    def _sum(self, outputs, free) -> Float[np.ndarray, "r n"]:
        starts = np.einsum("rns,rs->rn", free, self.starts)
        return outputs @ np.asarray(self.strengths) + starts

    @functools.cached_property
    def table(self) -> Float[np.ndarray, "r n s"]:
        """Return the signals of the element: its outputs, the derivatives of its force
        with respect to its parameters, and its free motions.
        """
        cells = [list(self.numbers)]
        for k, number in enumerate(self.kind.numbers):
            for sign in (-1, 1):
                moved = list(self.numbers)
                moved[k] = number.moved(moved[k], sign * _STEP)
                cells.append(moved)
        (outputs, free), *beside = self.kind.signals(self.driven, cells)
        table = np.zeros((*outputs.shape[:2], SHARED + STARTS))
        width = outputs.shape[-1]
        table[..., :width] = outputs
        for k, number in enumerate(self.kind.numbers):
            below, above = (self._sum(*one) for one in beside[2 * k : 2 * k + 2])
            low, high = (cell[k] for cell in cells[2 * k + 1 : 2 * k + 3])
            table[..., width + k] = (above - below) / number.change(low, high)
        table[..., SHARED : SHARED + free.shape[-1]] = free
        return table

    def element(self, point: Point, names: Sequence[str]) -> HiddenElement:
        """Return the element for a simulation."""
        return self.element_at(point.values[0], names)

    def element_at(self, values, names: Sequence[str]) -> HiddenElement:
        """Return the element for given values of all parameters `(q,)`, with respect to
        which it can be differentiated.
        """

        def at(name):
            return values[names.index(name)]

        numbers = {
            number.name: number.near(value, at(name))
            for number, value, name in zip(
                self.kind.numbers, self.numbers, self.changes
            )
        }
        outputs = {n: at(m) for n, m in zip(self.kind.outputs, self.outputs)}
        direct: list[Any] = [0.0] * DIRECT
        for k, name in zip(self.direct, self.direct_parts):
            direct[k] = at(name)
        constant, stiffness, damping = direct
        return self.kind.element(
            **numbers,
            **outputs,
            constant=constant,
            stiffness=stiffness,
            damping=damping,
            middle=self.driven.middle,
        )


def _moved(hidden: Hidden, changes: Sequence[float]) -> tuple[float, ...]:
    kind = hidden.kind
    return tuple(
        one.moved(value, change)
        for one, value, change in zip(kind.numbers, hidden.numbers, changes)
    )


def with_hidden(problem: Problem, hidden: Hidden) -> Problem:
    """Return the problem with the signals of an element in its slot."""
    table = hidden.table
    place = hidden_place(problem)
    width = len(hidden.outputs)
    starts = slice(SHARED, SHARED + hidden.kind.starts)
    force = table[..., :width] @ np.asarray(hidden.strengths)
    force = force + np.einsum("rns,rs->rn", table[..., starts], hidden.starts)
    usual = max(float(np.sqrt(np.mean(force**2))), 1e-12)

    def put(model: Model) -> Model:
        def parts(m) -> tuple[Any, ...]:
            term: Any = terms_of(m)[place]
            return term.table, term.begin, term.interval, term.middle

        driven = hidden.driven
        fresh = table, driven.begin, driven.interval, driven.middle
        return eqx.tree_at(parts, model, tuple(jnp.asarray(x, float) for x in fresh))

    size = np.sqrt(np.mean(table**2, axis=(0, 1)))
    change: dict[str, dict[str, float]] = {}
    for k, name in enumerate(hidden.outputs):
        change[name] = {"scale": usual / max(float(size[k]), 1e-12)}
    for number, value, name in zip(hidden.kind.numbers, hidden.numbers, hidden.changes):
        reach = hidden.kind.reach(number, hidden.numbers)
        low, high = number.span(value, reach)
        change[name] = {"scale": reach, "lower": low, "upper": high}
    for name in hidden.free_motions:
        known = math.sqrt(3) * _LARGEST_START * usual
        change[name] = {"scale": usual, "tolerance": known}
    sizes = 1.0, hidden.driven.spread, 10 * hidden.driven.spread
    for k, name in zip(hidden.direct, hidden.direct_parts):
        change[name] = {"scale": usual / sizes[k]}
    return dataclasses.replace(
        problem,
        model=put(problem.model),
        layout=eqx.tree_at(
            lambda part: part.model, problem.layout, put(problem.layout.model)
        ),
        parameters=tuple(
            dataclasses.replace(p, **change.get(p.name, {}))  # pyright: ignore
            for p in problem.parameters
        ),
    )


def hidden_place(problem: Problem) -> int:
    """Return the index of the hidden force among the terms of a problem."""
    for place, term in enumerate(terms_of(problem.model)):
        if isinstance(term, HiddenForce):
            return place
    raise ValueError("There is no slot for a hidden element.")


def started(problem: Problem, values, hidden: Hidden, direct=None) -> Array:
    """Return the parameter values of a problem, with those of an element inserted."""
    new = np.array(values)
    names = problem.names
    for name, value in zip(hidden.outputs, hidden.strengths):
        new[:, names.index(name)] = value
    for name in hidden.changes:
        new[:, names.index(name)] = 0.0
    for k, name in enumerate(hidden.free_motions):
        new[:, names.index(name)] = hidden.starts[:, k]
    if direct is not None:
        for k, name in zip(hidden.direct, hidden.direct_parts):
            new[:, names.index(name)] = direct[k]
    return jnp.asarray(new)


def recentred(problem: Problem, hidden: Hidden, point: Point) -> Hidden:
    """Return the element linearised about the result of a fit."""
    values, names = np.asarray(point.values), problem.names

    def at(name):
        return values[:, names.index(name)]

    return dataclasses.replace(
        hidden,
        numbers=_moved(hidden, [float(at(name)[0]) for name in hidden.changes]),
        strengths=tuple(float(at(name)[0]) for name in hidden.outputs),
        starts=np.stack([at(name) for name in hidden.free_motions], axis=-1),
    )
