"""Search for what explains one set of recordings at one location."""

import dataclasses
import math
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import NamedTuple

from ..fitting import Fit
from ._set_aside import odd_record
from .evidence import Choice, choose, Ripple, ripple_of, whole_flights
from .policy import Policy
from .report import Diagnosis, diagnosis_of
from .search import (
    Clock,
    KeptTrials,
    Missing,
    model_errors_dominate,
    Question,
    Report,
    Search,
    starting_at,
    Trial,
    Trials,
    with_fitted_speed,
    with_model_error,
)


class Conditions(NamedTuple):
    """What all searches of a diagnosis have in common."""

    case: str
    seed: int
    report: Report
    policy: Policy
    clock: Clock

    def trials(self, question: Question, keep: Path | None) -> Trials:
        """Return the fits of a question; those in a folder are kept."""
        problem, rig, terms = question.problem, question.rig, question.terms
        kept = None if keep is None else KeptTrials(keep, problem, self.policy)
        return Trials(problem, rig, terms, self.policy, self.report, kept, self.clock)


class Answer(NamedTuple):
    """A diagnosis, and the fits with functions, the best first, from which a further
    search in the same recordings, or in some of them, may start.

    `continued`, if given, seeks the functions that were not sought, because a single
    recording is inconsistent with the others.
    """

    diagnosis: Diagnosis
    functions: tuple[Missing, ...] = ()
    continued: Callable[[], "Answer"] | None = None

    @property
    def named(self) -> "Answer":
        """The same answer, from which only the named terms are used."""
        return self._replace(functions=())

    def with_functions(self) -> "Answer":
        """Return the answer after a search for functions in all recordings."""
        return self if self.continued is None else self.continued()


def answered(
    question: Question,
    keep: Path | None,
    conditions: Conditions,
    before: Answer | None = None,
) -> Answer:
    """Search for terms, test the result, and return the diagnosis.

    **Arguments:** an answer `before` provides the terms, functions and values from
    which the search may start.
    """
    _, _, report, policy, _ = conditions
    ripple = None
    if question.drives:
        report("examining the speed of the drive", None)
        ripple = ripple_of(
            question.drives, question.drive_noise, question.drive_channel, policy
        )
    trials = conditions.trials(question, keep)
    search = Search(trials)
    known, earlier = None, ()
    if before is not None:
        known = _again(trials, before.diagnosis.names, before.diagnosis.after)
        earlier = before.functions
    best = search.run()
    if known is not None and known.bic < best.bic:
        best = search.refined(known)
    sharper = with_fitted_speed(question, trials, best)
    if sharper is not None:
        question = sharper
        folder = None if keep is None else keep / "with_fitted_speed"
        trials = conditions.trials(question, folder)
        search = Search(trials)
        # known even if no time is left for the second search
        trials.attempt(best.names, best, policy.iterations)
        best = search.run()

    def concluded(sought: bool) -> Answer:
        named = _Named(question, trials, search, best)
        return _concluded(named, ripple, keep, conditions, earlier, sought)

    if odd_record(best.fit, policy) is None:
        return concluded(True)
    # a misread recording is no missing physics: functions are sought without it first
    return concluded(False)._replace(continued=lambda: concluded(True))


class _Named(NamedTuple):
    """A question, its fits, the search for named terms and the best subset."""

    question: Question
    trials: Trials
    search: Search
    best: Trial


def _concluded(
    named: _Named,
    ripple: Ripple | None,
    keep: Path | None,
    conditions: Conditions,
    earlier: Sequence[Missing],
    sought: bool,
) -> Answer:
    """Test the named terms, seek functions and return the diagnosis.

    **Arguments:** the named terms, the ripple of the drive, the folder of the kept
    fits, and the `earlier` fits with functions; `sought`: whether functions are sought.
    """
    question, trials, search, best = named
    case, seed, _, policy, _ = conditions
    bare, rough = trials.known[frozenset()], None
    far = model_errors_dominate(bare.fit, best.fit, policy)
    if far and sought:
        rough = _roughly(question, bare, keep, conditions, earlier)
    if rough is not None and not rough.choice.explained(policy):
        return Answer(diagnosis_of(case, *rough, ripple), rough.choice.functions)
    loosely = rough is not None and bool(rough.choice.functions)
    if rough is not None and loosely:
        # their fits to connected pieces may leave only noise; they began with those of
        # the answer before
        earlier = rough.choice.functions
    if rough is not None and rough.choice.named.best.names:
        # the physics was found, so that the stated noise can be used
        found = rough.choice.named.best
        again = _again(trials, found.names, found.fit)
        if again is not None and again.bic < best.bic:
            best = search.refined(again)
    choice = choose(question, trials, best, seed, sought, earlier, loosely)
    if rough is not None and rough.finds and not choice.explained(policy):
        return Answer(diagnosis_of(case, *rough, ripple), rough.choice.functions)
    found = diagnosis_of(case, question, trials, choice, ripple)
    return Answer(found, choice.functions)


def _again(trials: Trials, names: Collection[str], found: Fit) -> Trial | None:
    """Fit the terms of another problem, starting from their strengths there."""
    terms = frozenset(term.name for term in trials.terms if term.name in names)
    point = starting_at(found, trials.problem)
    start = Trial(terms, dataclasses.replace(found, point=point), math.inf, 0, False)
    return trials.attempt(terms, start, trials.policy.iterations)


class _Roughly(NamedTuple):
    """A question that allows for errors of the model, with its fits and the terms
    chosen.
    """

    question: Question
    trials: Trials
    choice: Choice

    @property
    def finds(self) -> bool:
        """Whether terms or functions were found."""
        named, unnamed = self.choice.named, self.choice.unnamed
        return bool(named.best.names) or unnamed.found is not None


def _roughly(
    question: Question,
    bare: Trial,
    keep: Path | None,
    conditions: Conditions,
    earlier: Sequence[Missing] = (),
) -> _Roughly | None:
    """Choose terms with joints and noise that allow for errors of the model.

    **Arguments:** `bare`: the fit of the textbook model to complete flights; `earlier`
    fits with functions.

    **Returns:** `None` if single pieces of flight hardly show the errors.
    """
    _, seed, report, policy, _ = conditions
    report("allowing for model errors", None)
    rough = with_model_error(question, policy)
    if rough is None:
        return None
    folder = None if keep is None else keep / "with_model_error"
    trials = conditions.trials(rough, folder)
    choice = choose(rough, trials, Search(trials).run(), seed, earlier=earlier)
    report("fitting complete flights", None)
    whole = whole_flights(bare.fit, choice.fit, rough.looseness, policy)
    return _Roughly(rough, trials, dataclasses.replace(choice, whole=whole))
