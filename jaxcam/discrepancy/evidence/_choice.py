"""Choose the explanation of the recordings from the result of a search."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

from ...fitting import Fit
from ..policy import Policy
from ..search import Missing, Question, Trial, Trials
from ._differing import Differing, differing
from ._held_out import held_out, HeldOut
from ._structure import Structure
from ._supported import bounded, Supported, supported
from ._unnamed import Rejected, rejected, trial_of, Unnamed, without_a_name
from ._whole_flights import WholeFlights


@dataclasses.dataclass(frozen=True, kw_only=True)
class Choice:
    """The result of a search and the evidence for it.

    - `named`: the named terms; `unnamed`: functions that explain more than these;
        `rejected`: such functions that do not predict held-out data.
    - `before`: the fit without terms, with the rig parameters held within their
        tolerances.
    - `held`: the prediction of held-out data.
    - `differing`: a parameter whose separate values in the recordings explain most of
        the residual of the chosen fit.
    - `tied`: a parameter whose separate values explain the data as well as the
        functions do.
    - `whole`: residuals over complete flights, if model errors were allowed for.
    """

    named: Supported
    unnamed: Unnamed
    rejected: Rejected | None
    before: Trial
    held: HeldOut
    differing: Differing | None
    tied: Differing | None
    whole: WholeFlights | None = None

    @property
    def fit(self) -> Fit:
        """The fit of the chosen model."""
        missing = self.unnamed.found
        return self.named.best.fit if missing is None else missing.fit

    @property
    def functions(self) -> tuple[Missing, ...]:
        """The fit with the functions of the choice, and those with others, in order of
        their evidence.
        """
        found, rivals = self.unnamed.found, self.unnamed.rivals
        return () if found is None else (found, *(one.missing for one in rivals))

    def explained(self, policy: Policy) -> bool:
        """Return whether the terms and functions leave only noise."""
        found = self.fit
        return found.cost < policy.as_noise**2 * found.problem.samples


def choose(
    question: Question,
    trials: Trials,
    found: Trial,
    seed: int,
    unnamed: bool = True,
    earlier: Sequence[Missing] = (),
    loosely: bool = False,
) -> Choice:
    """Decide what explains the recordings: named terms, separate parameter values in
    the recordings, or unnamed functions.

    **Arguments:** the question, its fits, the best subset of terms, the seed, whether
    unnamed functions are sought, and `earlier` fits with functions, with which the
    search begins; `loosely`: whether these fits allowed for model errors.
    """
    policy, textbook = trials.policy, trials.known[frozenset()]
    named = supported(question, trials, found, seed)
    separate = _separate_values(trials, named, textbook)
    functions, useless, predicted = Unnamed(), None, None
    instead = named.direction
    if instead is not None and not instead.preferred(policy):
        instead = None
    sought = (named.left or instead is not None) and not separate.settled
    if sought and unnamed and policy.functions:
        given = question, trials, named.best, named.left, instead, seed
        functions = without_a_name(*given, earlier, loosely)
    rest = _within(trials, textbook, named.best.fit)
    if functions.found is not None:
        missing = functions.found
        bare = _within(trials, textbook, missing.fit)
        held = held_out(trials, bare, trial_of(missing))
        useless = rejected(trials, missing, held, rest, named.best)
        predicted = bare, held
    if useless is not None:
        functions = Unnamed()
        named = dataclasses.replace(named, held=useless.named)
    fewest = _fewest(separate, named.best.bic, policy) if named.left else None
    if fewest is not None and fewest.bic < functions.score - policy.tie:
        # no function common to the recordings explains as much
        functions, separate = Unnamed(), separate._replace(settled=True)
    elif fewest is not None and fewest.bic > functions.score + policy.tie:
        fewest = None
    different = separate.added
    if separate.settled:
        named = dataclasses.replace(named, doubtful=[])
        if fewest is not None and fewest is separate.instead:
            # the terms only imitated the differences
            different, named = fewest, named.textbook(trials, textbook, seed)
            rest = textbook
    before, held = rest, named.held
    if functions.found is not None and predicted is not None:
        before, held = predicted
        different = differing(functions.found.fit, policy)
    return Choice(
        named=named,
        before=before,
        held=held or held_out(trials, before, named.best),
        unnamed=functions,
        rejected=useless,
        differing=different,
        tied=None if functions.found is None else fewest,
    )


class _Separate(NamedTuple):
    """Separate values of a parameter in the recordings: those `added` to the named
    terms, those `instead` of the terms, and whether either of them explains the
    recordings better than the terms, while no common function promises as much.
    """

    added: Differing | None
    instead: Differing | None
    settled: bool


def _separate_values(trials: Trials, named: Supported, textbook: Trial) -> _Separate:
    """Return separate values of a parameter, fitted with and without the named terms,
    which may only imitate differences between the recordings.
    """
    best, policy = named.best, trials.policy
    added, instead = differing(best.fit, policy, best.count), None
    settled = _settled(added, named.left, best.bic, policy)
    if named.left and best.names:
        instead = differing(textbook.fit, policy)
        settled |= _settled(instead, named.left_before, best.bic, policy)
    return _Separate(added, instead, settled)


def _fewest(separate: _Separate, bic: float, policy: Policy) -> Differing | None:
    """Return the separate values with the smallest BIC, if that is smaller than the BIC
    of the named terms, `bic`; in a tie, return those fitted without named terms.
    """
    without = separate.instead
    options = [one for one in (separate.added, without) if one is not None]
    explaining = [one for one in options if _explains(one, bic)]
    fewest = min(explaining, key=lambda one: one.bic, default=None)
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


def _within(trials: Trials, before: Trial, after: Fit) -> Trial:
    """Return the fit of the textbook model with its parameters within their
    tolerances, for a comparison with another fit.
    """
    if after is before.fit:
        return before
    return dataclasses.replace(before, fit=bounded(trials, before.fit, after))
