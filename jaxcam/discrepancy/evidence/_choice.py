"""Choose the terms to be named from the result of a search."""

import dataclasses
import math
from typing import NamedTuple

from ...fitting import Fit
from ..policy import Policy
from ..search import Missing, Question, Trial, Trials, within_tolerances
from ._beyond_tolerance import acting_alike, Beyond, beyond_tolerance
from ._differing import Differing, differing
from ._held_out import held_out, HeldOut
from ._masked import unmasked
from ._redrawn import Needs, redrawn, sure
from ._rivals import Rival
from ._structure import Structure, structures
from ._unnamed import rather_named, trial_of, without_a_name
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


def choose(
    question: Question, trials: Trials, found: Trial, seed: int, unnamed: bool = True
) -> Choice:
    """Drop terms that only a few blocks of the recordings support, and test the
    residuals of the remaining terms.

    **Arguments:** the question, its fits, the best subset of terms, the seed, and
    whether unnamed functions are sought.

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
    if left and unnamed and trials.policy.functions and not settled:
        missing, needed_parts, others = without_a_name(
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
    textbook = before
    before = _within(trials, textbook, best.fit if missing is None else missing.fit)
    if missing is not None:
        held = held_out(trials, before, trial_of(missing))
        rest = _within(trials, textbook, best.fit)
        named = rather_named(trials, rest, best, held)
        if named is not None:
            missing, needed_parts, others = None, None, ()
            before, held = rest, named
        else:
            different = differing(missing.fit, trials.policy)
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
    return max(common, default=0.0) < policy.common_gain * different.gained


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


def _within(trials: Trials, before: Trial, after: Fit) -> Trial:
    """Return the fit of the textbook model with its parameters within their
    tolerances, for a comparison with another fit.
    """
    if after is before.fit:
        return before
    return dataclasses.replace(before, fit=_bounded(trials, before.fit, after))


def _bounded(trials: Trials, less: Fit, best: Fit) -> Fit:
    """Return a fit with the rig parameters held within their tolerances."""
    return within_tolerances(less, best, trials.rig, trials.policy)


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
