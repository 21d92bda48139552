"""Rank additions to a fit: functions, terms, and forces with an internal state."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...fitting import Problem
from ..policy import Policy
from ..terms import Factor, Family, Variable, Where
from ._blocks import blocks_of
from ._free_fits import FreeFits, Missing
from ._gains import added_gain
from ._heat import heat_of, heated, unscaled
from ._hidden_leads import worthwhile
from ._hidden_scan import Promise
from ._hidden_signals import Driven
from ._hidden_state import Hidden
from ._local_force import force_blocks, force_response, Response
from ._roughness import Roughness, roughness
from ._slots import filled, Free, free_term, slots_of
from ._unexplained import completing_gain


class Lead(NamedTuple):
    """A candidate function, element or term, with its predicted gain.

    `decoy` is the gain of a function of the same family that acts reversed in time, as
    a fraction of `gain`; `None` if it was not computed.
    """

    gain: float
    name: str | None = None
    family: Family | None = None
    rough: Roughness | None = None
    slot: str = ""
    promise: Promise | None = None
    decoy: float | None = None

    @property
    def label(self) -> str:
        if self.promise is not None:
            return self.promise.hidden.label
        return self.name or (self.family.name if self.family else "")


class Leads:
    """Ranks possible additions to a fit by a quadratic likelihood about it.

    **Arguments:** the fits of subsets, families of functions, names of the possible
    sensor errors, the policy, and `progress(sentence, fraction)`.
    """

    def __init__(
        self,
        fits: FreeFits,
        families: Sequence[Family],
        faults: Sequence[str],
        policy: Policy,
        progress: Callable[[str, float | None], None],
    ):
        self.fits, self.families = fits, tuple(families)
        self.faults, self.policy, self.progress = tuple(faults), policy, progress
        # functions and terms ranked before, with the fit and the problem
        self._known: list[tuple[Missing, Problem, bool, list[Lead]]] = []

    def ranked(
        self,
        problem: Problem,
        found: Missing,
        apart: bool,
        driven: Driven | None = None,
    ) -> list[Lead]:
        """Return all candidates, the largest gain first; with `apart`, impacts are not
        used. Forces with an internal state are candidates if the position that drives
        them is given.
        """
        leads = self._functions_and_terms(problem, found, apart)
        if driven is not None and self._has_room(found):
            leads = [*leads, *self._elements(problem, found, driven)]
        return sorted(leads, key=lambda lead: -lead.gain)

    def _functions_and_terms(
        self, problem: Problem, found: Missing, apart: bool
    ) -> list[Lead]:
        for one, where, alone, leads in self._known:
            if one is found and where is problem and alone == apart:
                return leads
        self.progress("searching the residuals for functions", None)
        heated_problem = _heated(problem, found)
        leads = list(self._terms(heated_problem, found))
        enough = (
            completing_gain(self.fits, found) if of_two_arguments(found) else math.inf
        )
        # other functions beside one of two arguments take many times longer to rank
        if not any(lead.gain > enough for lead in leads):
            leads += self._in_flight(heated_problem, found)
            leads += self._elsewhere(heated_problem, found, apart)
        self._known.append((found, problem, apart, leads))
        return leads

    def _elements(
        self, problem: Problem, found: Missing, driven: Driven
    ) -> Iterator[Lead]:
        self.progress("searching for forces with an internal state", None)
        problem, heat = _heated(problem, found), heat_of(found.fit)
        response = force_response(problem, found.fit.point, self.fits.free(found))
        for grown, one in worthwhile(problem, response, driven, self.policy, heat):
            yield Lead(grown, promise=one)

    def _slot(
        self, problem: Problem, found: Missing, where: Where, gap: int = 0
    ) -> str | None:
        """Return a free slot for one more function, or `None`."""
        used = {one.slot for one in found.functions}
        if len(used) >= self.policy.functions:
            return None
        return next((s for s in slots_of(problem, where, gap) if s not in used), None)

    def _in_flight(self, problem: Problem, found: Missing) -> Iterator[Lead]:
        slot = self._slot(problem, found, Where.FLIGHT)
        forces = [one for one in self.families if one.where is Where.FLIGHT]
        if slot is None or not forces:
            return
        response = force_response(problem, found.fit.point, self.fits.free(found))
        # one family at a time, because all at once would need gigabytes of memory
        leads = [
            Lead(rough.gain, None, family, rough, slot)
            for family in forces
            for rough in [self._force(problem, found, family, response)]
        ]
        leads.sort(key=lambda lead: -lead.gain)
        for number, lead in enumerate(leads):
            bare = not found.functions and not found.names
            first = bare and number < self.policy.followed
            yield self._against_decoy(problem, found, lead, response) if first else lead

    def _has_room(self, found: Missing) -> bool:
        """Return whether a force with an internal state can be added: no problem has
        room for two of them, or for one and a force of two arguments.
        """
        slots = {one.slot for one in found.functions}
        full = any(isinstance(f, Hidden) or f.across for f in found.functions)
        return len(slots) < self.policy.functions and not full

    def _force(
        self,
        problem: Problem,
        found: Missing,
        family: Family,
        response: Response,
        decoy: bool = False,
    ) -> Roughness:
        heat = heat_of(found.fit)
        term = free_term(family, "new")
        blocks = force_blocks(problem, response, [term], decoy)
        information, score = (x / heat for x in blocks.total())
        rows = blocks.rows(response.free)
        own = blocks.rows([p.name for p in term.parameters(0)])
        zero = np.zeros(len(own))
        return roughness(information, score, rows, own, family, zero, self.policy)

    def _against_decoy(
        self, problem: Problem, found: Missing, lead: Lead, response: Response
    ) -> Lead:
        family = lead.family
        assert family is not None
        # a function of time or phase alone, reversed in time, is another function of
        # the same family, and therefore no decoy
        alone = family.factor is Factor.ONE
        clock = family.argument in (Variable.TIME, Variable.PHASE)
        if (alone and clock) or not lead.gain > 0:
            return lead
        rough = self._force(problem, found, family, response, decoy=True)
        return lead._replace(decoy=max(rough.gain, 0.0) / lead.gain)

    def _elsewhere(
        self, problem: Problem, found: Missing, apart: bool
    ) -> Iterator[Lead]:
        """Yield the candidates that act on the surface, on a sensor or at impacts."""
        free, heat = self.fits.free(found), heat_of(found.fit)
        # impacts contain no information if they do not connect the pieces
        places = {Where.CONTACT, Where.SENSOR, *([] if apart else [Where.IMPACT])}
        for family in self.families:
            slot = self._slot(problem, found, family.where, family.constraint)
            if family.where not in places or slot is None:
                continue
            one = Free(family, Roughness(), slot)
            put, names = filled(problem, [one], prior=False), one.coefficients
            beside = free
            if family.where is Where.SENSOR:
                beside = list(dict.fromkeys([*free, *self.faults]))
            blocks = blocks_of(put, found.fit.point, names=[*beside, *names])
            information, score = unscaled(blocks, names, heat)
            rows, own = blocks.rows(beside), blocks.rows(names)
            zero = np.zeros(len(own))
            rough = roughness(information, score, rows, own, family, zero, self.policy)
            yield Lead(rough.gain, None, family, rough, slot)

    def _terms(self, problem: Problem, found: Missing) -> Iterator[Lead]:
        terms = [t for t in self.fits.terms if t.name not in found.names]
        if not terms:
            return
        free, heat = self.fits.free(found), heat_of(found.fit)
        strengths = [one.name for t in terms for one in t.strengths()]
        blocks = blocks_of(problem, found.fit.point, names=[*free, *strengths])
        information, score = blocks.total()
        rows = blocks.rows(free)
        for term in terms:
            own = blocks.rows([one.name for one in term.strengths()])
            grown = added_gain(
                information, score, rows, own, self.policy.distinct_information
            )
            price = len(own) * math.log(problem.samples)
            yield Lead(grown / heat - price, term.name)


def _heated(problem: Problem, found: Missing) -> Problem:
    """Return the problem with the functions of a fit, and with the weight of its priors
    increased if the fit is poor.
    """
    return heated(filled(problem, found.functions), heat_of(found.fit))


def others(
    leads: Sequence[Lead],
    alone: Mapping[str, Missing],
    tried: Sequence[Missing],
    policy: Policy,
) -> list[Lead]:
    """Return the candidates for the first function that were not fitted to whole
    recordings, except those that single pieces of flight rule out. Additions to a force
    of two arguments do not count.

    **Arguments:** all candidates; the fits of single pieces with one of them, by its
    label; the fits of whole recordings; and the policy.
    """
    of_one = (trial for trial in tried if not of_two_arguments(trial))
    fitted = {one.label for trial in of_one for one in trial.functions}
    costs = {label: one.fit.cost for label, one in alone.items()}
    most = policy.hopeless_cost * min(costs.values(), default=math.inf)
    return [
        lead
        for lead in leads
        if lead.family is not None
        and lead.label not in fitted
        and costs.get(lead.label, 0.0) <= most
    ]


def of_two_arguments(found: Missing) -> bool:
    """Return whether a fit contains a free force of two arguments."""
    return any(isinstance(one, Free) and one.across for one in found.functions)


def tie(alone: Mapping[str, Missing], label: str, chosen: str, policy: Policy) -> bool:
    """Return whether single pieces of flight do not clearly prefer the chosen function
    to another one.
    """
    if label not in alone or chosen not in alone:
        return False
    one, other = alone[label], alone[chosen]
    return one.score < other.score + policy.tie * heat_of(other.fit)


def decoys_of(leads: Sequence[Lead], found: Missing) -> tuple[tuple[str, float], ...]:
    """Return the labels of the functions in a fit, with the gains of their decoys."""
    labels = {one.label for one in found.functions}
    return tuple(
        (lead.label, lead.decoy)
        for lead in leads
        if lead.label in labels and lead.decoy is not None
    )


def shows_apart(family: Family) -> bool:
    """Return whether disconnected pieces contain information on a function."""
    drifts = family.where is Where.SENSOR and family.argument is Variable.TIME
    return family.where is not Where.IMPACT and not drifts
