"""What is reported of an effect: its numbers, where it is seen, and the evidence."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from ..evidence import Choice, Ripple
from ..policy import Policy
from ..search import Missing, Trial, Trials, value_of
from ..terms import DriveRipple, Value
from ._diagnosis import Effect, Verdict
from ._missing import MissingFunction, sentence_of


def term_effect(trials: Trials, choice: Choice, name: str) -> Effect:
    """A term that is named."""
    term, best = trials.term(name), choice.best
    less = trials.known.get(best.names - {name}, choice.before)
    parameters = {
        one.name: Value(
            best.fit[one.name].value,
            max(best.fit[one.name].stderr, choice.deviation.get(one.name, 0.0)),
            one.unit,
        )
        for one in term.strengths()
    }
    return Effect(
        name,
        term.sentence,
        term.reported(parameters),
        term.where,
        term.region,
        _seen_in(trials, best, [one.name for one in term.strengths()]),
        best.bic - less.bic,
        choice.held.total,
        choice.inclusion[name],
    )


def _seen_in(trials: Trials, best: Trial, names) -> tuple[str, ...]:
    """Records in which the effect is more than chance."""
    blocks = trials.blocks(best)
    rows = blocks.rows(names)
    found = []
    for k, record in enumerate(blocks.record):
        value = np.array([value_of(best.fit, blocks.names[r]) for r in rows])
        value = value / blocks.scale[rows]
        inside = blocks.information[k][np.ix_(rows, rows)]
        if value @ inside @ value > chi2.isf(trials.policy.shown_chance, len(rows)):
            found.append(record)
    return tuple(found)


def drive_effect(ripple: Ripple, policy: Policy) -> Effect:
    """A ripple of the drive."""
    term = DriveRipple()
    seen = tuple(
        name
        for name, (eps, error) in ripple.per_record.items()
        if eps > policy.ripple_errors * error
    )
    return Effect(
        term.name,
        term.sentence,
        {
            "eps": Value(ripple.eps, ripple.eps_stderr, "-"),
            "psi": Value(ripple.psi, ripple.psi_stderr, "rad"),
        },
        term.where,
        term.region,
        seen,
        ripple.delta_bic,
        ripple.heldout_gain,
        ripple.inclusion,
    )


def free_effect(
    functions: Sequence[MissingFunction], missing: Missing, choice: Choice
) -> Effect:
    """What has no name, all functions together."""
    return Effect(
        Verdict.UNKNOWN,
        sentence_of(functions),
        {},
        missing.functions[0].family.where,
        "; ".join(one.words for one in functions),
        functions[0].records,
        missing.score - choice.before.bic,
        choice.held.total,
        1.0,
        term=False,
    )


def named_effect(trials: Trials, missing: Missing, choice: Choice, name: str) -> Effect:
    """A term that is named beside functions without a name."""
    term = trials.term(name)
    parameters = {
        one.name: Value(
            missing.fit[one.name].value, missing.fit[one.name].stderr, one.unit
        )
        for one in term.strengths()
    }
    return Effect(
        name,
        term.sentence,
        term.reported(parameters),
        term.where,
        term.region,
        missing.fit.problem.records,
        -missing.gains.get(name, 0.0),
        choice.held.total,
        1.0,
    )


def unknown_effect(trials: Trials, choice: Choice) -> Effect:
    """What is left over and has no name."""
    first, problem = choice.unexplained[0], trials.problem
    return Effect(
        Verdict.UNKNOWN,
        first.sentence,
        {},
        first.where,
        first.place,
        problem.records,
        -first.gain + first.count * math.log(problem.samples),
        choice.held.total,
        1.0,
        term=False,
    )
