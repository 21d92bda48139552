"""The subset that is named, once it has been doubted."""

import dataclasses

from ..search import Question, Search, Trial, Trials
from ._held_out import held_out, HeldOut
from ._masked import unmasked
from ._redrawn import redrawn, sure
from ._structure import Structure, structures


@dataclasses.dataclass(frozen=True)
class Choice:
    """What a search ended with, and the evidence for it.

    - `found`: the best subset; `best`: the part of it that is named; `before`: none.
    - `inclusion`, `deviation`: of the bootstrap, by term and by parameter.
    - `doubtful`: terms that were dropped, with the share of the bootstrap samples that
        keep them; `needed`: those that are named all the same.
    - `masked`: terms that were dropped, with their shares of what is explained, because
        the corner of another one leaves as much.
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

    @property
    def unexplained(self) -> list[Structure]:
        """Structures that are left over for sure, largest excess first."""
        return [one for one in self.left_after if one.significant]


def choose(question: Question, trials: Trials, seed: int) -> Choice:
    """Search, drop what hangs on a few blocks, and look at what is left over.

    A term in doubt is named where nothing is left over with it and much is without it,
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
        held or held_out(trials, before, best),
        masked,
    )


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
