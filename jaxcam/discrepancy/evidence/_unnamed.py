"""Seek unnamed functions that explain the residual of the named terms."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from ..policy import Policy
from ..search import (
    decoys_of,
    Free,
    FreeSearch,
    in_one_direction,
    Missing,
    OneDirection,
    Question,
    rank_decoys,
    refitted,
    Shuffled,
    Trial,
    Trials,
)
from ..terms import EVERY, families, Family, gaps_of
from ._held_out import held_out, HeldOut
from ._redrawn import Needs, needs
from ._rivals import Rival, rivals
from ._structure import Structure
from ._visited_states import visited_states


class Unnamed(NamedTuple):
    """Unnamed functions, `None` if there are none, and the evidence for them.

    `needs` are their bootstrap results, and `rivals` are other functions that were
    fitted in their place. `by_chance`: forces that are not reported, because a
    knockoff explains as much.
    """

    found: Missing | None = None
    needs: Needs | None = None
    rivals: tuple[Rival, ...] = ()
    by_chance: tuple[Shuffled, ...] = ()

    @property
    def score(self) -> float:
        """The BIC of the fit with the functions; infinite without functions."""
        return math.inf if self.found is None else self.found.score


def without_a_name(
    question: Question,
    trials: Trials,
    best: Trial,
    left: list[Structure],
    instead: OneDirection | None,
    seed: int,
    earlier: Sequence[Missing] = (),
    loosely: bool = False,
) -> Unnamed:
    """Return the functions that explain the residual of the named terms, chosen by
    their evidence.

    Two kinds of residual do not count: one near the noise that is small compared with
    the part explained by a named term, and one that the smoothing of dry friction may
    leave. Several terms that leave such a residual, however, may only imitate a single
    function, which is then chosen if it is a simpler explanation. Functions that the
    bootstrap samples do not retain are dropped. If one of the `earlier` fits, refitted
    to these recordings, leaves only noise, nothing else is sought. If these fits
    allowed for model errors (`loosely`), no other residual is tolerated, because the
    right function may not be among them.

    Friction in one direction of motion is tried `instead` of Coulomb friction. If it
    leaves only noise, or if what Coulomb friction leaves does not count, nothing else
    is sought.
    """
    policy, bare = trials.policy, trials.known[frozenset()].fit.cost
    problem = question.problem
    near = best.fit.cost < policy.near_cost * problem.samples
    small = policy.small if near else policy.corner_share
    most = max((one.gain for one in left), default=0.0)
    if not _admits(question, best):
        instead = None
    tolerable = bool(best.names) and most < small * (bare - best.fit.cost)
    imitated = tolerable and instead is None
    if imitated and (len(best.names) < 2 or not left):
        return Unnamed()
    offered = _offered(question, policy)
    by_chance: list[Shuffled] = []

    def new_search(elements: bool) -> FreeSearch:
        return FreeSearch(
            problem,
            question.rig,
            question.terms,
            offered,
            policy,
            trials.progress,
            bare,
            elements,
            # the answer is known: time that this search takes is not lacking elsewhere
            None if imitated else trials.clock,
            bool(question.model_errors),
        )

    def searched(search: FreeSearch):
        known = refitted(search, () if search.elements else earlier)
        if known is None or search.falls_short(known, tolerated=not loosely):
            others = search.run()
            found = [one for one in (known, others) if one is not None]
            known = min(found, key=lambda one: one.score, default=None)
        else:
            rank_decoys(search, known)
        if imitated and not (known and _simpler(search, known, best)):
            return search, None, None
        return search, *_needed(search, known, best.bic, seed, by_chance)

    if instead is not None:
        search = new_search(False)
        known = in_one_direction(search, offered, best, instead)
        if tolerable or not search.falls_short(known):
            rank_decoys(search, known)
            found, its = _needed(search, known, best.bic, seed, by_chance)
            if found is not None or tolerable:
                return Unnamed(found, its, by_chance=tuple(by_chance))
    # elements with an internal state are tried only if functions may not suffice
    always = policy.elements > 1
    results = [searched(new_search(always))]
    first, found, _ = results[0]
    lacking = not (imitated or always) and first.lacks_element(found)
    if lacking and not trials.clock.over:
        results.append(searched(first.repeated(True)))
        second, found, _ = results[-1]
        if first.need.preferred and second.falls_short(found):
            # the first search ended before it had tried functions alone
            results.append(searched(first.repeated(False)))
    kept = [(one, its) for _, one, its in results if one is not None]
    if not kept:
        return Unnamed(by_chance=() if imitated else tuple(by_chance))
    chosen, its_needs = min(kept, key=lambda each: each[0].score)
    tried = [one for search, _, _ in results for one in search.tried]
    return Unnamed(chosen, its_needs, rivals(chosen, tried, policy, seed))


def _offered(question: Question, policy: Policy) -> tuple[Family, ...]:
    """Return the families of functions over the ranges that the recordings visit."""
    visited = visited_states(question.problem)
    positions, velocities, approach, times = visited.ranges(policy)
    return families(
        positions,
        velocities,
        approach,
        times,
        turned=question.turned,
        gaps=_gaps_with_impacts(question, policy),
        slip=question.references.slip_speed,
        motion_unit=question.unit,
        strides=visited.strides,
    )


def _simpler(search: FreeSearch, found: Missing, best: Trial) -> bool:
    """Return whether a single form, or a product of two, leaves only noise, has at most
    as many parameters as several terms, and has clearly more evidence.
    """
    one, *others = found.functions
    if others or found.names or not isinstance(one, Free):
        return False
    if one.primitive is None or one.primitive.parts or one.count > best.count:
        return False
    better = found.score < best.bic - search.policy.tie
    return better and not search.falls_short(found, tolerated=False)


def _admits(question: Question, best: Trial) -> bool:
    """Return whether the named terms can be fitted together with functions: none of
    them has an inner parameter.
    """
    named = [term for term in question.terms if term.name in best.names]
    return not any(one.inner for term in named for one in term.strengths())


def _gaps_with_impacts(question: Question, policy: Policy) -> tuple[int, ...]:
    """Return the gaps at which functions are sought: none if there are no impacts,
    otherwise the first gaps and the gap of the location.
    """
    problem = question.problem
    if not any(len(part.impacts.approach) for part in problem.segments):
        return ()
    first = range(min(gaps_of(problem), policy.functions))
    return tuple(sorted({*first, question.location.constraint} - {EVERY}))


def _needed(
    search: FreeSearch,
    found: Missing | None,
    bic: float,
    seed: int,
    by_chance: list[Shuffled],
) -> tuple[Missing | None, Needs | None]:
    """Drop functions and terms that the bootstrap samples do not retain, and forces
    that explain no more than their knockoffs, which are added to `by_chance`.

    **Returns:** the fit with the others, and their bootstrap results; `None` for both
    if no function is left, or if the score of the fit is not below `bic`.
    """
    policy = search.policy
    while found is not None and found.functions and found.score < bic:
        parts, prices = search.fits.parts(found), search.fits.prices(found)
        fitted = found.fit
        needed = needs(
            fitted.problem, fitted, parts, prices, policy, seed, names=fitted.free
        )
        least = min(needed.inclusion, key=lambda one: needed.inclusion[one])
        if needed.inclusion[least] >= policy.confidence:
            compared = search.shuffled(found, seed)
            chance = [one for one in compared if one.by_chance]
            if not chance:
                found = search.fits.polished(found)
                decoys = decoys_of(search.first or (), found)
                return found._replace(decoys=decoys, shuffled=compared), needed
            worst = max(chance, key=lambda one: one.best)
            by_chance.append(worst)
            least = worst.label
        if len(parts) < 2:
            break
        found = search.without(found, least)
    return None, None


def trial_of(missing: Missing) -> Trial:
    """Return a fit with functions as a trial, for a prediction of held-out data."""
    names = missing.names | {"functions"}
    return Trial(names, missing.fit, missing.score, 0, False)


class Rejected(NamedTuple):
    """Functions that explain the recordings but predict held-out data no better than
    the `named` terms do, or hardly better than the textbook model.
    """

    functions: Missing
    held: HeldOut
    named: HeldOut


def rejected(
    trials: Trials, found: Missing, held: HeldOut, before: Trial, best: Trial
) -> Rejected | None:
    """Return functions that do not predict held-out data, or `None` if they do.

    Functions of the time, or of a state visited only once, may explain the recordings
    and yet predict nothing.

    **Arguments:** the functions and their prediction of held-out data; the fits without
    and with the named terms, whose prediction is computed only if that by functions is
    hardly better than that of the textbook model.
    """
    policy = trials.policy
    useless = not _predictive(held, found.fit.problem.samples, policy)
    better = held.after < policy.explains * held.before or not best.names
    if better and not useless:
        return None
    named = held_out(trials, before, best)
    if useless or named.after < held.after:
        return Rejected(found, held, named)
    return None


def _predictive(held: HeldOut, samples: int, policy: Policy) -> bool:
    """Return whether functions explain enough of the squared residual on held-out data
    above the noise, if there is any.
    """
    before, after = held.before**2 - 1, held.after**2 - 1
    certain = before > policy.cost_errors * math.sqrt(2 / samples)
    return not certain or after < policy.explains * before
