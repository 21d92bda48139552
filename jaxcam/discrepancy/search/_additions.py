"""Fit a candidate in addition to the functions and terms of a fit."""

import math

from ..terms import Where
from ._free_fits import FreeFits, Missing, Subset
from ._hidden_state import started
from ._leads import Lead, shows_apart
from ._rooms import Rooms
from ._slots import emptied, Free
from ._starting_at import starting_at


class Additions:
    """Fits with one more function, element or term.

    **Arguments:** the fits of subsets, and the problems with room for the candidates.
    """

    def __init__(self, fits: FreeFits, rooms: Rooms):
        self.fits, self.rooms = fits, rooms

    def fitted(
        self, found: Missing, lead: Lead, apart: bool, beaten: float = math.inf
    ) -> Missing | None:
        """Return a fit with a candidate, or `None` if it fails.

        **Arguments:** the fit and the candidate; `apart`: whether it is fitted to
        disconnected pieces of flight; a fit whose cost does not fall below `beaten` may
        be stopped.
        """
        functions, names = found.functions, found.names
        point, trial, room = found.fit.point, None, self.rooms.of(found)
        if lead.promise is not None:
            hidden, direct = lead.promise.hidden, lead.promise.direct
            room, functions = self.rooms.with_element, (*functions, hidden)
            point = starting_at(found.fit, room.whole)
            values = started(room.whole, point.values, hidden, direct)
            point = point._replace(values=values)
        elif lead.family is not None:
            assert lead.rough is not None
            functions = (*functions, Free(lead.family, lead.rough, lead.slot))
            values = emptied(room.whole, point.values, lead.slot)
            point = point._replace(values=values)
        else:
            assert lead.name is not None
            names = names | {lead.name}
        problem = room.apart if apart else room.whole
        if self._shows_apart(lead):
            # a force is almost linear if impacts do not connect the pieces
            subset = Subset(room.apart, functions, names)
            trial = self.fits.fitted(subset, point, beaten=beaten)
            point, functions = trial.fit.point, trial.functions
        if trial is None or problem is not room.apart:
            if trial is not None and not trial.fit.cost < beaten:
                return None
            subset = Subset(problem, functions, names)
            trial = self.fits.fitted(subset, point, beaten=beaten)
        return trial if math.isfinite(trial.score) else None

    def _shows_apart(self, lead: Lead) -> bool:
        """Return whether disconnected pieces show the effect of a candidate."""
        if lead.promise is not None:
            return True
        if lead.family is not None:
            return shows_apart(lead.family)
        term = next(term for term in self.fits.terms if term.name == lead.name)
        return Where.FLIGHT in term.acts or Where.CONTACT in term.acts
