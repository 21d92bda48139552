"""Where in a system missing physics is sought: a coordinate and a gap."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp

from ...fitting import Sensor
from ...hybrid import HybridSystem
from ._term import Term
from ._with_terms import WithTerms


class Location(NamedTuple):
    """Indices of the coordinate and of the gap on which missing physics acts."""

    coordinate: int = 0
    constraint: int = 0

    def first(self, pairs: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
        """Return the coordinates of a system, beginning with that of the location."""
        return tuple(pairs[k] for k in self._order(len(pairs)))

    def of_library(self, term: Term) -> Term:
        """Return a term of the library at this location; forces and sensor errors
        belong to the first coordinate.
        """
        return dataclasses.replace(term, constraint=self.constraint)

    def reordered(self, term: Term, coordinates: int) -> Term:
        """Return a term of one's own, which keeps its coordinate in the new order."""
        place = self._order(coordinates).index(term.coordinate)
        return dataclasses.replace(term, coordinate=place)

    def _order(self, number: int) -> list[int]:
        others = [k for k in range(number) if k != self.coordinate]
        return [self.coordinate, *others]

    def said(
        self, system: HybridSystem, pairs: tuple[tuple[int, int], ...]
    ) -> tuple[str, str]:
        """Return the names of the coordinate and of the gap; numbers if they have
        none.
        """
        states, gaps = system.state_names, system.constraint_names
        place = pairs[self.coordinate][0]
        return (
            states[place] if states else str(self.coordinate + 1),
            gaps[self.constraint] if gaps else str(self.constraint + 1),
        )


def other_locations(
    system: HybridSystem,
    pairs: tuple[tuple[int, int], ...],
    sensors: Mapping[str, Sensor],
) -> list[Location]:
    """Return the locations at another measured coordinate or another gap than the
    first.
    """
    measured = {one.observe for one in sensors.values() if isinstance(one.observe, int)}
    found = [
        Location(coordinate=k)
        for k, (place, _) in enumerate(pairs)
        if k and place in measured
    ]
    number = gaps_of(WithTerms(system, (), pairs))
    return found + [Location(constraint=c) for c in range(1, number)]


def gaps_of(system) -> int:
    """Return the number of gaps of a system with terms."""
    state = jax.ShapeDtypeStruct((1 + max(map(max, system.coordinates)),), jnp.float64)
    time = jax.ShapeDtypeStruct((), jnp.float64)
    return jax.eval_shape(system.base.gap, time, state).size
