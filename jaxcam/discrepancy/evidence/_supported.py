"""Name the terms that the evidence supports, and test what they leave."""

import dataclasses
from typing import NamedTuple

from ...fitting import Fit
from ..policy import Policy
from ..search import (
    one_direction,
    OneDirection,
    Question,
    Trial,
    Trials,
    within_tolerances,
)
from ._beyond_tolerance import acting_alike, Beyond, beyond_tolerance
from ._held_out import held_out, HeldOut
from ._masked import unmasked
from ._redrawn import redrawn, sure
from ._structure import Structure, structures


class Outside(NamedTuple):
    """A parameter outside its tolerance, and the term named in its place.

    `term` is empty if no term acts like the parameter; `lost` is the increase in the
    cost if neither the term nor the excess is allowed.
    """

    parameter: Beyond
    term: str = ""
    lost: float = 0.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Supported:
    """The named terms, and the evidence for them.

    - `found`: the best subset of terms; `best`: the fit with those that are named.
    - `inclusion`, `deviation`: results of the bootstrap, by term and by parameter.
    - `doubtful`: terms that were dropped, with the fraction of the bootstrap samples
        that retain them; `needed`: those that are named nevertheless.
    - `masked`: terms that were dropped because they may only compensate for the
        smoothed corner of another term, with their fractions of the explained cost.
    - `imitating`: terms that were dropped because they only imitate an effect that
        remains, with the sentence of this effect.
    - `beyond`: rig parameters that are outside their tolerances.
    - `left_before`, `left_after`: structures in the residuals of the textbook model,
        and of the named terms.
    - `held`: a prediction of held-out data, if one was needed.
    - `direction`: friction in one direction of motion, if Coulomb friction is named.
    """

    found: Trial
    best: Trial
    inclusion: dict[str, float]
    deviation: dict[str, float]
    doubtful: list[tuple[str, float]]
    needed: list[tuple[str, float]]
    masked: list[tuple[str, float]]
    imitating: list[tuple[str, str]]
    beyond: list[Outside]
    left_before: list[Structure]
    left_after: list[Structure]
    held: HeldOut | None
    direction: OneDirection | None

    @property
    def left(self) -> list[Structure]:
        """The significant structures that the named terms leave."""
        return [one for one in self.left_after if one.significant]

    def textbook(self, trials: Trials, before: Trial, seed: int) -> "Supported":
        """Return the same evidence with no term named."""
        inclusion, deviation = redrawn(trials, before, seed)
        return dataclasses.replace(
            self,
            best=before,
            inclusion=inclusion,
            deviation=deviation,
            needed=[],
            beyond=[],
            left_after=self.left_before,
            held=None,
            direction=None,
        )


def supported(question: Question, trials: Trials, found: Trial, seed: int) -> Supported:
    """Drop terms that only a few blocks of the recordings support, and test the
    residuals of the remaining terms.

    A doubtful term is named if no structure remains with it but much remains without
    it, provided that it explains more than an error of the form of the other terms
    could, and that it improves the prediction of held-out data.

    **Arguments:** the question, its fits, the best subset of terms, and the seed.
    """
    trials.progress("drawing bootstrap samples", None)
    found, masked = unmasked(trials, found)
    best, inclusion, deviation, doubtful = sure(trials, found, seed)
    before = trials.known[frozenset()]
    trials.progress("testing the residuals", None)
    left_before = _left(question, trials, before)
    left_after = _left(question, trials, best) if best.names else left_before
    held, needed = None, []
    # a remainder may be due to the functional form of the certain terms
    lost, gained = (one.fit.cost - found.fit.cost for one in (best, before))
    much = lost > trials.policy.small * gained
    if doubtful and much and any(one.significant for one in left_after):
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
    imitating: list[tuple[str, str]] = []
    while (wrong := _imitating(left_after, trials.policy)) is not None:
        imitating.append(wrong)
        best = trials.without(best, wrong[0])
        inclusion, deviation = redrawn(trials, best, seed)
        left_after = _left(question, trials, best) if best.names else left_before
        held, needed = None, []
    beyond, best = _instead(trials, best, deviation)
    inclusion |= {one.term: one.parameter.chance for one in beyond if one.term}
    return Supported(
        found=found,
        best=best,
        inclusion=inclusion,
        deviation=deviation,
        doubtful=doubtful,
        needed=needed,
        masked=masked,
        imitating=imitating,
        beyond=beyond,
        left_before=left_before,
        left_after=left_after,
        held=held,
        direction=one_direction(trials, best),
    )


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
            lost = bounded(trials, best.fit, trial.fit).cost - trial.fit.cost
            outside, best = Outside(one, name, lost), trial
            break
        found.append(outside)
    return found, best


def bounded(trials: Trials, less: Fit, best: Fit) -> Fit:
    """Return a fit with the rig parameters held within their tolerances."""
    return within_tolerances(less, best, trials.rig, trials.policy)


def _imitating(left: list[Structure], policy: Policy) -> tuple[str, str] | None:
    """Return the named term that imitates a remaining structure most, if any, and the
    sentence of this structure.
    """
    found = [
        (each.beside / each.alone, name, one.sentence)
        for one in left
        if one.significant
        for name, each in one.named.items()
        if each.imitates(one.gain, policy)
    ]
    return min(found)[1:] if found else None


def _left(question: Question, trials: Trials, trial: Trial) -> list[Structure]:
    parts = {
        name: [one.name for one in trials.term(name).strengths()]
        for name in sorted(trial.names)
    }
    return structures(
        trial.fit,
        trials.response(trial.names),
        question.unlisted,
        trials.scan(trial.names),
        question.turned,
        question.references,
        question.unit,
        trials.policy,
        parts,
    )
