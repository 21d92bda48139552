"""Locations in a system at which missing physics is sought: coordinates and gaps."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from ...fitting import Problem
from ...fitting.engine import filtered_channels
from ...hybrid import HybridSystem
from ._term import Term


class Location(NamedTuple):
    """Indices of the coordinate and of the gap on which missing physics acts."""

    coordinate: int = 0
    constraint: int = 0

    def first(self, pairs: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
        """Return the coordinates of a system, beginning with that of the location."""
        return tuple(pairs[k] for k in self._order(len(pairs)))

    def of_library(self, term: Term) -> Term:
        """Return a term of the library at this location.

        Only its gap is set: forces and sensor errors act on the first coordinate, which
        `first` makes that of the location.
        """
        return dataclasses.replace(term, constraint=self.constraint)

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
        return coordinate, system.constraint_name(self.constraint)


def other_locations(problem: Problem) -> list[Location]:
    """Return the locations other than the first: the other measured coordinates, and
    the other gaps.
    """
    system, sensors = problem.model.system, problem.model.sensors
    pairs = system.coordinates  # pyright: ignore
    measured = {one.observe for one in sensors.values() if isinstance(one.observe, int)}
    found = [
        Location(coordinate=k)
        for k, (place, _) in enumerate(pairs)
        if k and place in measured
    ]
    return found + [Location(constraint=c) for c in range(1, gaps_of(problem))]


def gaps_of(problem: Problem) -> int:
    """Return the number of gaps of the system of a problem."""
    size = problem.start.states.shape[-1] - len(filtered_channels(problem.model))
    state = jax.ShapeDtypeStruct((size,), jnp.float64)
    time = jax.ShapeDtypeStruct((), jnp.float64)
    base = problem.model.system.base  # pyright: ignore
    return jax.eval_shape(base.gap, time, state).size
