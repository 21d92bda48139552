"""A problem with room for functions, and for others only in fits that have them."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import NamedTuple

from ...fitting import Problem
from ...fitting.engine import separated
from ..terms import Bivariate, Family, Where
from ._bivariate_likelihood import bivariate_forces
from ._free_fits import Missing
from ._hidden_signals import Driven, driven_by
from ._slots import Part, ROOM_OF_TWO_ARGUMENTS, roomy


class Room(NamedTuple):
    """A problem with disconnected pieces of flight (`apart`), and with connected ones
    (`whole`).
    """

    apart: Problem
    whole: Problem

    @property
    def stages(self) -> tuple[Problem, ...]:
        """Return the problems in the order in which a force is fitted to them."""
        return (self.whole,) if self.apart is self.whole else (self.apart, self.whole)


class Rooms:
    """A problem with room for functions, and the same with room for an element.

    Room for an element makes every fit slower.

    **Arguments:** the problem; families of functions; whether an element may be needed;
    and whether model errors are allowed for, so that the pieces are hardly connected
    anyway.
    """

    def __init__(
        self, problem: Problem, families: Sequence[Family], element: bool, roughly: bool
    ):
        self._problem, self._families, self._roughly = problem, families, roughly
        unit = families[0].motion_unit
        # the position that drives an element, if it is measured
        self.driven = driven_by(problem, unit) if element else None
        self.plain = self._with(None)

    def _with(self, driven: Driven | None, bivariate: Bivariate | None = None) -> Room:
        at_impacts = [f for f in self._families if f.where is Where.IMPACT]
        gaps = sorted({one.constraint for one in at_impacts})
        whole = roomy(self._problem, self._families[0], gaps, driven, bivariate)
        if self._roughly:
            return Room(whole, whole)
        return Room(dataclasses.replace(whole, extras=separated(whole.extras)), whole)

    @functools.cached_property
    def with_element(self) -> Room:
        """Return the problems with room for an element."""
        return self._with(self.driven)

    @functools.cached_property
    def with_two_arguments(self) -> Room:
        """Return the problems with room for a force of two arguments."""
        return self._with(None, bivariate_forces(self._families)[0])

    def of(self, found: Missing) -> Room:
        """Return the problems that have the parameters of a fit."""
        # a room that was not built yet contains no fit
        made = vars(self)
        rooms = (made.get(name) for name in ("plain", "with_two_arguments"))
        for room in rooms:
            if room is not None and room.whole.names == found.problem.names:
                return room
        return self.with_element

    def for_functions(self, functions: Sequence[Part]) -> Room:
        """Return the problems without room for an element that have slots for the
        functions of a fit to other recordings.
        """
        of_two = ROOM_OF_TWO_ARGUMENTS in {one.slot for one in functions}
        return self.with_two_arguments if of_two else self.plain
