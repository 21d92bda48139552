"""Choose the terms to be named from the result of a search."""

import dataclasses
import math
from typing import NamedTuple

from ...fitting import Fit
from ..policy import Policy
from ..search import (
    decoys_of,
    FreeSearch,
    Missing,
    Question,
    Trial,
    Trials,
    within_tolerances,
)
from ..terms import families, gaps_of
from ._beyond_tolerance import acting_alike, Beyond, beyond_tolerance
from ._differing import Differing, differing
from ._held_out import held_out, HeldOut
from ._masked import unmasked
from ._redrawn import Needs, needs, redrawn, sure
from ._rivals import Rival, rivals
from ._structure import Structure, structures
from ._visited_states import visited_states
from ._whole_flights import WholeFlights


class Outside(NamedTuple):
    """A parameter outside its tolerance, and the term named in its place.

    `term` is empty if no term acts like the parameter; `lost` is the increase in the
    cost if neither the term nor the excess is allowed.
    """

    parameter: Beyond
    term: str = ""
    lost: float = 0.0


@dataclasses.dataclass(frozen=True)
class Choice:
    """The result of a search and the evidence for it.

    - `found`: the best subset; `best`: the named part of it; `before`: the fit
        without terms, with the rig parameters held within their tolerances.
    - `inclusion`, `deviation`: results of the bootstrap, by term and by parameter.
    - `doubtful`: terms that were dropped, with the fraction of the bootstrap samples
        that retain them; `needed`: those that are named nevertheless.
    - `masked`: terms that were dropped because they may only compensate for the
        smoothed corner of another term, with their fractions of the explained cost.
    - `beyond`: rig parameters that are outside their tolerances.
    - `missing`: unnamed functions that explain more than named terms;
        `needs`: their bootstrap results, by label; `rivals`: other functions that were
        fitted in their place.
    - `differing`: a parameter whose separate values in the recordings explain most of
        the residual of the chosen fit.
    - `tied`: a parameter whose separate values explain the data as well as the
        functions do.
    - `whole`: residuals over complete flights, if model errors were allowed for.
    - `left_before`, `left_after`: structures in the residuals of `before` and `best`.
    """

    found: Trial
    best: Trial
    before: Trial
    inclusion: dict[str, float]
    deviation: dict[str, float]
    doubtful: list[tuple[str, float]]
    needed: list[tuple[str, float]]
    left_before: list[Structure]
    left_after: list[Structure]
    held: HeldOut
    masked: list[tuple[str, float]] = dataclasses.field(default_factory=list)
    beyond: list[Outside] = dataclasses.field(default_factory=list)
    missing: Missing | None = None
    needs: Needs | None = None
    rivals: tuple[Rival, ...] = ()
    differing: Differing | None = None
    tied: Differing | None = None
    whole: WholeFlights | None = None

    @property
    def unexplained(self) -> list[Structure]:
        """Return the significant remaining structures: those with a shape first, each
        kind by its excess over the threshold."""
        return [one for one in self.left_after if one.significant]

    @property
    def fit(self) -> Fit:
        """The fit of the chosen model."""
        return self.best.fit if self.missing is None else self.missing.fit

    def explained(self, policy: Policy) -> bool:
        """Return whether the terms and functions leave only noise."""
        found = self.fit
        return found.cost < policy.as_noise**2 * found.problem.samples


def choose(question: Question, trials: Trials, found: Trial, seed: int) -> Choice:
    """Drop terms that only a few blocks of the recordings support, and test the
    residuals of the remaining terms.

    **Arguments:** the question, its fits, the best subset of terms, and the seed.

    A doubtful term is named if no structure remains with it but much remains without
    it, provided that it improves the prediction of held-out data.
    """
    trials.progress("drawing bootstrap samples", None)
    found, masked = unmasked(trials, found)
    best, inclusion, deviation, doubtful = sure(trials, found, seed)
    before = trials.known[frozenset()]
    trials.progress("testing the residuals", None)
    left_before = _left(question, trials, before)
    left_after = _left(question, trials, best) if best.names else left_before
    held, needed = None, []
    if doubtful and any(one.significant for one in left_after):
        # some discrepancy is certain: test whether the doubtful terms explain it
        with_all = _left(question, trials, found)
        if not any(one.significant for one in with_all):
            whole = held_out(trials, before, found)
            # the terms must improve the prediction of held-out data, or each half of
            # the recordings must support the strengths estimated from the other
            if whole.after < whole.before or trials.foretells(best, found):
                best, left_after, held = found, with_all, whole
                needed, doubtful = doubtful, []
                inclusion, deviation = redrawn(trials, best, seed)
    beyond, best = _instead(trials, best, deviation)
    inclusion |= {one.term: one.parameter.chance for one in beyond if one.term}
    missing, needed_parts, others = None, None, ()
    left = [one for one in left_after if one.significant]
    different = differing(best.fit, trials.policy, best.count)
    settled = _settled(different, left, best.bic, trials.policy)
    without = None
    if left and best.names:
        # the named terms may only imitate differences between the recordings
        without = differing(before.fit, trials.policy)
        settled |= _settled(without, left_before, best.bic, trials.policy)
    if left and trials.policy.functions and not settled:
        missing, needed_parts, others = _without_a_name(
            question, trials, best, left, seed
        )
    fewest = _fewest(different, without, best.bic, trials.policy) if left else None
    likely = math.inf if missing is None else missing.score
    if fewest is not None and fewest.bic < likely - trials.policy.tie:
        # no function common to the recordings explains as much
        missing, needed_parts, others = None, None, ()
        settled = True
    elif fewest is not None and fewest.bic > likely + trials.policy.tie:
        fewest = None
    if settled:
        doubtful = []
        if fewest is not None and fewest is without:
            # the terms only imitated the differences
            different, best, left_after, held = without, before, left_before, None
            inclusion, deviation = redrawn(trials, best, seed)
            needed, beyond = [], []
    after = best.fit if missing is None else missing.fit
    if after is not before.fit:
        # report the textbook model with its parameters within their tolerances
        before = dataclasses.replace(before, fit=_bounded(trials, before.fit, after))
    if missing is not None:
        different = differing(missing.fit, trials.policy)
        nameless = Trial(
            missing.names | {"functions"}, missing.fit, missing.score, 0, False
        )
        held = held_out(trials, before, nameless)
    held = held or held_out(trials, before, best)
    return Choice(
        found,
        best,
        before,
        inclusion,
        deviation,
        doubtful,
        needed,
        left_before,
        left_after,
        held,
        masked,
        beyond,
        missing,
        needed_parts,
        others,
        different,
        None if missing is None else fewest,
    )


def _fewest(
    different: Differing | None, without: Differing | None, bic: float, policy: Policy
) -> Differing | None:
    """Return the separate values with the smallest BIC, if that is smaller than the BIC
    of the named terms; in a tie, return those fitted without named terms.

    **Arguments:** separate values in addition to the named terms, and without them; the
    BIC of the terms.
    """
    options = [one for one in (different, without) if one is not None]
    separate = [one for one in options if _explains(one, bic)]
    fewest = min(separate, key=lambda one: one.bic, default=None)
    if fewest is None or without is None or not _explains(without, bic):
        return fewest
    # terms that hardly improve a fit with separate values only imitate these values
    return without if without.bic < fewest.bic + policy.tie else fewest


def _settled(
    different: Differing | None, left: list[Structure], bic: float, policy: Policy
) -> bool:
    """Return whether separate values of a parameter leave only noise and have a smaller
    BIC than the named terms, while no function common to the recordings promises as
    much.
    """
    if different is None or not _explains(different, bic):
        return False
    common = [one.gain for one in left if one.significant]
    return max(common, default=0.0) < policy.as_much * different.gained


def _explains(different: Differing, bic: float) -> bool:
    """Return whether separate values leave only noise and have a smaller BIC."""
    return different.complete and different.bic < bic


def _instead(trials: Trials, best: Trial, deviation) -> tuple[list[Outside], Trial]:
    """Find parameters outside their tolerances, and terms named in their place.

    **Returns:** these parameters and terms, and the fit with the terms.
    """
    found = []
    for one in beyond_tolerance(trials, best, deviation):
        outside = Outside(one)
        for name in acting_alike(trials, best, one.name):
            trial = trials.attempt(best.names | {name}, best, trials.policy.iterations)
            # with the term, the parameter must be within its tolerance again
            if trial is None or not one.low <= trial.fit[one.name].value <= one.high:
                continue
            lost = _bounded(trials, best.fit, trial.fit).cost - trial.fit.cost
            outside, best = Outside(one, name, lost), trial
            break
        found.append(outside)
    return found, best


def _bounded(trials: Trials, less: Fit, best: Fit) -> Fit:
    """Return a fit with the rig parameters held within their tolerances."""
    return within_tolerances(less, best, trials.rig, trials.policy)


def _without_a_name(
    question: Question, trials: Trials, best: Trial, left: list[Structure], seed: int
) -> tuple[Missing | None, Needs | None, tuple[Rival, ...]]:
    """Return the functions that explain the residual of the named terms, chosen by
    their evidence.

    Two kinds of residual do not count: one near the noise that is small compared with
    the part explained by a named term, and one that the smoothing of dry friction may
    leave. Functions that the bootstrap samples do not retain are dropped.
    """
    policy, bare = trials.policy, trials.known[frozenset()].fit.cost
    problem = question.problem
    near = best.fit.cost < policy.near * problem.samples
    small = policy.small if near else policy.corner_share
    if best.names and max(one.gain for one in left) < small * (bare - best.fit.cost):
        return None, None, ()
    visited = visited_states(problem)
    positions, velocities, approach, duration = visited.ranges(policy)
    offered = families(
        positions,
        velocities,
        approach,
        duration,
        turned=question.turned,
        gaps=_gaps_with_impacts(question, policy),
        slip=question.references.slip_speed,
        motion_unit=question.unit,
        strides=visited.strides,
    )

    def searched(elements: bool, policy: Policy = policy):
        search = FreeSearch(
            problem,
            question.rig,
            question.terms,
            offered,
            policy,
            trials.progress,
            bare,
            elements,
            trials.clock,
        )
        return search, *_needed(search, search.run(), best.bic, seed)

    # elements with an internal state are tried only if functions may not suffice
    always = policy.elements > 1
    results = [searched(always)]
    first, found, _ = results[0]
    if not always and first.lacks_element(found) and not trials.clock.over:
        results.append(searched(True))
        second, found, _ = results[-1]
        if first.need.preferred and second.falls_short(found):
            # the first search ended before it had tried functions alone
            results.append(searched(False, dataclasses.replace(policy, elements=0)))
    kept = [(one, its) for _, one, its in results if one is not None]
    if not kept:
        return None, None, ()
    chosen, its_needs = min(kept, key=lambda each: each[0].score)
    tried = [one for search, _, _ in results for one in search.tried]
    return chosen, its_needs, rivals(chosen, tried, policy, seed)


def _gaps_with_impacts(question: Question, policy: Policy) -> tuple[int, ...]:
    """Return the gaps at which functions are sought: none if there are no impacts,
    otherwise the first gaps and the gap of the location.
    """
    problem = question.problem
    if not any(len(part.impacts.approach) for part in problem.segments):
        return ()
    first = range(min(gaps_of(problem), policy.functions))
    return tuple(sorted({*first, question.location.constraint}))


def _needed(
    search: FreeSearch, found: Missing | None, bic: float, seed: int
) -> tuple[Missing | None, Needs | None]:
    """Drop functions and terms that the bootstrap samples do not retain.

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
        if needed.inclusion[least] >= policy.sure:
            return found._replace(decoys=decoys_of(search.first or (), found)), needed
        if len(parts) < 2:
            break
        found = search.without(found, least)
    return None, None


def _left(question: Question, trials: Trials, trial: Trial) -> list[Structure]:
    return structures(
        trial.fit,
        trials.response(trial.names),
        question.unlisted,
        trials.scan(trial.names),
        question.turned,
        question.references,
        question.unit,
        trials.policy,
    )
