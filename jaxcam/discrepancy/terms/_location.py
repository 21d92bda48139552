"""Locations in a system at which missing physics is sought: coordinates and gaps."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from ...fitting import Problem
from ...fitting.engine import filtered_channels
from ...hybrid import HybridSystem
from ._term import EVERY, Term
from ._where import Where


class Location(NamedTuple):
    """Indices of the coordinate and of the gap on which missing physics acts; `EVERY`
    for all gaps.
    """

    coordinate: int = 0
    constraint: int = 0

    @property
    def numbered(self) -> str:
        """Return the location in words, with numbers counted from one."""
        if self.coordinate:
            return f"coordinate {self.coordinate + 1}"
        return "all gaps" if self.constraint == EVERY else f"gap {self.constraint + 1}"

    def first(self, pairs: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
        """Return the coordinates of a system, beginning with that of the location."""
        return tuple(pairs[k] for k in self._order(len(pairs)))

    def of_library(self, term: Term) -> Term:
        """Return a term of the library at this location.

        Only its gap is set: forces and sensor errors act on the first coordinate, which
        `first` makes that of the location.
        """
        constraint = self.constraint
        if constraint == EVERY and Where.CONTACT in term.acts:
            # each surface has errors of its own
            constraint = 0
        return dataclasses.replace(term, constraint=constraint)

    def reordered(self, term: Term, coordinates: int) -> Term:
        """Return a user's term with the index that its coordinate has in the order of
        `first`.

        **Raises:** `ValueError` if there is no such coordinate.
        """
        if not -coordinates <= term.coordinate < coordinates:
            raise ValueError(
                f"The term {term.name!r} acts on coordinate {term.coordinate}, but the "
                f"system has {coordinates}; they are counted from 0."
            )
        place = self._order(coordinates).index(term.coordinate % coordinates)
        return dataclasses.replace(term, coordinate=place)

    def _order(self, number: int) -> list[int]:
        others = [k for k in range(number) if k != self.coordinate]
        return [self.coordinate, *others]

    def said(
        self, system: HybridSystem, pairs: tuple[tuple[int, int], ...]
    ) -> tuple[str, str]:
        """Return the names of the coordinate and of the gap, or their indices if they
        have no names.
        """
        states, place = system.state_names, pairs[self.coordinate][0]
        coordinate = (
            states[place] if place < len(states) else f"state component {place}"
        )
        if self.constraint == EVERY:
            return coordinate, "every gap"
        return coordinate, system.constraint_name(self.constraint)


def other_locations(problem: Problem) -> list[Location]:
    """Return the locations other than the first: the other measured coordinates, the
    other gaps, and all gaps.
    """
    system, sensors = problem.model.system, problem.model.sensors
    pairs = system.coordinates  # pyright: ignore
    measured = {one.observe for one in sensors.values() if isinstance(one.observe, int)}
    found = [
        Location(coordinate=k)
        for k, (place, _) in enumerate(pairs)
        if k and place in measured
    ]
    gaps = list(range(1, gaps_of(problem)))
    return found + [Location(constraint=c) for c in (*gaps, *([EVERY] if gaps else []))]


def gaps_of(problem: Problem) -> int:
    """Return the number of gaps of the system of a problem."""
    size = problem.start.states.shape[-1] - len(filtered_channels(problem.model))
    state = jax.ShapeDtypeStruct((size,), jnp.float64)
    time = jax.ShapeDtypeStruct((), jnp.float64)
    base = problem.model.system.base  # pyright: ignore
    return jax.eval_shape(base.gap, time, state).size
