"""What is reported of an effect: its numbers, where it is seen, and the evidence."""

import math

import numpy as np
from scipy.stats import chi2

from ..fitting import Problem
from ._diagnosis import Effect, Value
from ._drive import Ripple
from ._engine import value_of
from ._structure import Structure
from ._terms import DriveRipple
from ._trials import FALSE_ALARMS, Trial, Trials


def ripples(ripple: Ripple, tests: int) -> bool:
    asked = max(2 * math.log(ripple.count), chi2.isf(FALSE_ALARMS / tests, 2))
    return bool(ripple.gain > asked)


def term_effect(
    trials: Trials, best: Trial, before: Trial, name, inclusion, deviation, gained
) -> Effect:
    term = trials.term(name)
    less = trials.known.get(best.names - {name}, before)
    parameters = {
        one.name: Value(
            best.fit[one.name].value,
            max(best.fit[one.name].stderr, deviation.get(one.name, 0.0)),
            one.unit,
        )
        for one in term.strengths()
    }
    if name == "external_vibration":
        parameters = _polar(parameters)
    records = _seen_in(trials, best, [one.name for one in term.strengths()])
    alone = sum(gained.values())
    return Effect(
        name,
        term.sentence,
        parameters,
        term.where,
        term.region,
        records,
        best.bic - less.bic,
        alone,
        inclusion[name],
    )


def _polar(parts: dict[str, Value]) -> dict[str, Value]:
    a, b, fe = parts["ext_sin"], parts["ext_cos"], parts["fe"]
    size = math.hypot(a.value, b.value)
    error = math.hypot(a.value * a.stderr, b.value * b.stderr) / size
    phase = math.hypot(a.value * b.stderr, b.value * a.stderr) / size**2
    return {
        "ext": Value(size, error, "rad/s^2"),
        "fe": fe,
        "phase": Value(math.atan2(b.value, a.value), phase, "rad"),
    }


def _seen_in(trials: Trials, best: Trial, names) -> tuple[str, ...]:
    """Records in which the effect is larger than three of their own errors."""
    blocks = trials.blocks(best)
    rows = blocks.rows(names)
    found = []
    for k, record in enumerate(blocks.record):
        value = np.array([value_of(best.fit, blocks.names[r]) for r in rows])
        value = value / blocks.scale[rows]
        inside = blocks.information[k][np.ix_(rows, rows)]
        if value @ inside @ value > chi2.isf(1e-3, len(rows)):
            found.append(record)
    return tuple(found)


def drive_effect(ripple: Ripple) -> Effect:
    term = DriveRipple()
    seen = tuple(
        name for name, (eps, error) in ripple.per_record.items() if eps > 3 * error
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


def unknown_effect(unexplained: list[Structure], problem: Problem, gained) -> Effect:
    first = unexplained[0]
    return Effect(
        "unknown",
        first.sentence,
        {},
        first.where,
        first.place,
        problem.records,
        -first.gain + first.count * math.log(problem.samples),
        sum(gained.values()),
        1.0,
    )
