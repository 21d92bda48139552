"""The subset that is named, once it has been doubted."""

import dataclasses
from typing import NamedTuple

from ...fitting import Fit
from ..search import (
    FreeSearch,
    Missing,
    Question,
    Search,
    Trial,
    Trials,
    within_tolerances,
)
from ..terms import families
from ._beyond_tolerance import acting_alike, Beyond, beyond_tolerance
from ._held_out import held_out, HeldOut
from ._masked import unmasked
from ._redrawn import Needs, needs, redrawn, sure
from ._rivals import Rival, rivals
from ._structure import Structure, structures
from ._visited_states import visited_states


class Outside(NamedTuple):
    """A parameter outside its tolerance, and the term named in its place.

    `term` is empty where no term acts like the parameter; `lost` is the growth of the
    cost where neither the term nor the excess is allowed.
    """

    parameter: Beyond
    term: str = ""
    lost: float = 0.0


@dataclasses.dataclass(frozen=True)
class Choice:
    """The result of a search, and the evidence for it.

    - `found`: the best subset; `best`: the part of it that is named; `before`: no term,
        the parameters of the rig held within their tolerances.
    - `inclusion`, `deviation`: of the bootstrap, by term and by parameter.
    - `doubtful`: terms that were dropped, with the share of the bootstrap samples that
        keep them; `needed`: those that are named all the same.
    - `masked`: terms that were dropped, with their shares of what is explained, because
        the corner of another one leaves as much.
    - `beyond`: parameters of the rig that are outside their tolerances.
    - `missing`: functions without a name that explain more than terms that have one;
        `needs`: how much they are needed, by their labels; `rivals`: other functions
        that were fitted in their place.
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

    @property
    def unexplained(self) -> list[Structure]:
        """Structures that are left over for sure, largest excess first."""
        return [one for one in self.left_after if one.significant]


def choose(question: Question, trials: Trials, seed: int) -> Choice:
    """Search, drop what hangs on a few blocks, and look at what remains.

    A term in doubt is named where nothing remains with it and much is without it,
    if it improves the prediction of held-out records.
    """
    found = Search(trials).run()
    trials.progress("redrawing stretches of the records", None)
    found, masked = unmasked(trials, found)
    best, inclusion, deviation, doubtful = sure(trials, found, seed)
    before = trials.known[frozenset()]
    trials.progress("looking at what is left over", None)
    left_before = _left(question, trials, before)
    left_after = _left(question, trials, best) if best.names else left_before
    held, needed = None, []
    if doubtful and any(one.significant for one in left_after):
        # that something is there is sure; what explains all of it is what it is
        with_all = _left(question, trials, found)
        if not any(one.significant for one in with_all):
            whole = held_out(trials, before, found)
            # a term must improve the prediction of held-out data; more is not asked of
            # it than of a shape
            if whole.after < whole.before or trials.foretells(best, found):
                best, left_after, held = found, with_all, whole
                needed, doubtful = doubtful, []
                inclusion, deviation = redrawn(trials, best, seed)
    beyond, best = _instead(trials, best, deviation)
    inclusion |= {one.term: one.parameter.chance for one in beyond if one.term}
    missing, needed_parts, others = None, None, ()
    left = [one for one in left_after if one.significant]
    if left and trials.policy.functions:
        missing, needed_parts, others = _without_a_name(
            question, trials, best, left, seed
        )
    after = best.fit if missing is None else missing.fit
    if after is not before.fit:
        # the textbook model has its parameters where the rig file allows them
        before = dataclasses.replace(before, fit=_bounded(trials, before.fit, after))
    if missing is not None:
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
    )


def _instead(trials: Trials, best: Trial, deviation) -> tuple[list[Outside], Trial]:
    """Parameters outside their tolerances, and terms named in their place.

    **Returns:** these, and the fit with the terms.
    """
    found = []
    for one in beyond_tolerance(trials, best, deviation):
        outside = Outside(one)
        for name in acting_alike(trials, best, one.name):
            trial = trials.attempt(best.names | {name}, best, trials.policy.iterations)
            # the term takes up the excess: the parameter is back in its tolerance
            if trial is None or not one.low <= trial.fit[one.name].value <= one.high:
                continue
            lost = _bounded(trials, best.fit, trial.fit).cost - trial.fit.cost
            outside, best = Outside(one, name, lost), trial
            break
        found.append(outside)
    return found, best


def _bounded(trials: Trials, less: Fit, best: Fit) -> Fit:
    """A fit with the parameters of the rig held within their tolerances."""
    return within_tolerances(less, best, trials.rig, trials.policy)


def _without_a_name(
    question: Question, trials: Trials, best: Trial, left: list[Structure], seed: int
) -> tuple[Missing | None, Needs | None, tuple[Rival, ...]]:
    """Functions that explain what the named terms leave over, by their evidence.

    What is left after a named term but is small beside what that explains is none, and
    what the bootstrap samples can do without is not needed.
    """
    policy, bare = trials.policy, trials.known[frozenset()].fit.cost
    small = policy.small * (bare - best.fit.cost)
    if best.names and max(one.gain for one in left) < small:
        return None, None, ()
    problem = question.problem
    positions, velocities, approach, duration = visited_states(problem).ranges(policy)
    search = FreeSearch(
        problem,
        question.rig,
        question.terms,
        families(
            positions,
            velocities,
            approach,
            duration,
            turned=question.turned,
            impacting=any(len(part.impacts.approach) for part in problem.segments),
            slip=question.references.slip_speed,
            motion_unit=question.unit,
        ),
        policy,
        trials.progress,
        bare,
    )
    found = search.run()
    while found is not None and found.functions and found.score < best.bic:
        parts, prices = search.fits.parts(found), search.fits.prices(found)
        fitted = found.fit
        needed = needs(
            fitted.problem, fitted, parts, prices, policy, seed, names=fitted.free
        )
        least = min(needed.inclusion, key=lambda one: needed.inclusion[one])
        if needed.inclusion[least] >= policy.sure:
            return found, needed, rivals(found, search.tried, policy, seed)
        if len(parts) < 2:
            break
        found = search.without(found, least)
    return None, None, ()


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
