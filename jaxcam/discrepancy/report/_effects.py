"""Report an effect: its parameters, its location and the evidence."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import chi2

from ...fitting import Fit
from ..evidence import Choice, Needs, Ripple, Shares
from ..policy import Policy
from ..search import Blocks, blocks_of, FittedSpeed, Missing, Trials, values_of
from ..terms import DriveRipple, Term, Value
from ._diagnosis import Effect, Verdict
from ._missing import MissingFunction, sentence_of


def term_effects(
    trials: Trials, choice: Choice, share: Mapping[str, float]
) -> list[Effect]:
    """Return the named terms, the one that explains most of the misfit first.

    **Arguments:** `share`: the fraction of the misfit that each of them explains.
    """
    best, blocks = choice.named.best, trials.blocks(choice.named.best)
    instead = {one.term: one.lost for one in choice.named.beyond if one.term}
    found = []
    for name in sorted(best.names, key=lambda name: (-share[name], name)):
        without = trials.known.get(best.names - {name})
        less = without or choice.before
        delta, lost = best.bic - less.bic, less.fit.cost - best.fit.cost
        if name in instead:
            delta = trials.count([name]) * math.log(trials.problem.samples)
            delta, lost = delta - instead[name], instead[name]
        known = without is not None or name in instead
        found.append(
            _of_term(
                trials.term(name),
                best.fit,
                blocks,
                choice.named.deviation,
                delta,
                choice.held.total,
                choice.named.inclusion[name],
                trials.policy,
                share[name],
                _rms_without(best.fit, lost) if known else None,
            )
        )
    return found


def _rms_without(best: Fit, lost: float) -> float:
    """Return the rms residual without an effect, in units of the noise, given the
    increase in the cost.
    """
    return math.sqrt((best.cost + max(lost, 0.0)) / best.problem.samples)


def with_speed(effect: Effect, found: FittedSpeed | None) -> Effect:
    """Return an effect with its fitted reference speed, `v0`, if it has one."""
    if found is None or found.term != effect.name:
        return effect
    parameters = {
        name: dataclasses.replace(
            one, stderr=math.hypot(one.stderr, found.errors.get(name, 0.0))
        )
        for name, one in effect.parameters.items()
    }
    parameters["v0"] = found.speed
    return dataclasses.replace(effect, parameters=parameters)


def missing_effects(
    trials: Trials,
    functions: Sequence[MissingFunction],
    missing: Missing,
    needs: Needs,
    choice: Choice,
    divided: Shares,
) -> list[Effect]:
    """Return the unnamed effect (all functions together) and the named terms."""
    fitted, held, policy = missing.fit, choice.held.total, trials.policy
    blocks = blocks_of(fitted.problem, fitted.point, names=fitted.free)
    labels = [one.label for one in missing.functions]
    seen = [
        record
        for one in missing.functions
        for record in _seen_in(blocks, fitted, coefficients(fitted, one.slot), policy)
    ]
    whole = Effect(
        name=Verdict.UNKNOWN,
        sentence=sentence_of(functions),
        parameters={},
        where=missing.functions[0].where,
        region="; ".join(one.words for one in functions),
        records=tuple(dict.fromkeys(seen)),
        delta_bic=missing.score - choice.before.bic,
        heldout_gain_nats=held,
        inclusion=min(needs.inclusion[label] for label in labels),
        term=False,
        share=sum(divided.of[label] for label in labels),
        rms_without=_rms_without(fitted, needs.worse[labels[0]])
        if len(labels) == 1
        else None,
    )
    return [whole] + [
        _of_term(
            trials.term(name),
            fitted,
            blocks,
            needs.deviation,
            -needs.lost[name],
            held,
            needs.inclusion[name],
            policy,
            divided.of[name],
            _rms_without(fitted, needs.worse[name]),
        )
        for name in sorted(missing.names)
    ]


def coefficients(found: Fit, slot: str) -> list[str]:
    """Return the names of the coefficients of a fitted free function."""
    return [name for name in found.free if name.startswith(f"{slot}_")]


def _of_term(
    term: Term,
    found: Fit,
    blocks: Blocks,
    deviation: Mapping[str, float],
    delta_bic: float,
    gained: float,
    inclusion: float,
    policy: Policy,
    share: float,
    rms_without: float | None,
) -> Effect:
    strengths = term.strengths()
    parameters = {
        one.name: Value(
            found[one.name].value,
            max(found[one.name].stderr, deviation.get(one.name, 0.0)),
            one.unit,
        )
        for one in strengths
    }
    return Effect(
        name=term.name,
        sentence=term.sentence,
        parameters=term.reported(parameters),
        where=term.where,
        region=term.described(),
        records=_seen_in(blocks, found, [one.name for one in strengths], policy),
        delta_bic=delta_bic,
        heldout_gain_nats=gained,
        inclusion=inclusion,
        share=share,
        rms_without=rms_without,
    )


def _seen_in(blocks: Blocks, found: Fit, names, policy: Policy) -> tuple[str, ...]:
    """Return the recordings in which the effect is significant."""
    rows = blocks.rows(names)
    value = values_of(found, blocks)[rows]
    seen = []
    for k, record in enumerate(blocks.record):
        inside = blocks.information[k][np.ix_(rows, rows)]
        if value @ inside @ value > chi2.isf(policy.shown_chance, len(rows)):
            seen.append(record)
    return tuple(seen)


def drive_effect(ripple: Ripple, policy: Policy) -> Effect:
    """Return the ripple of the drive as an effect."""
    term = DriveRipple()
    seen = tuple(
        name
        for name, (eps, error) in ripple.per_record.items()
        if eps > policy.ripple_errors * error
    )
    return Effect(
        name=term.name,
        sentence=term.sentence,
        parameters={
            "eps": Value(ripple.eps, ripple.eps_stderr, "-"),
            "psi": Value(ripple.psi, ripple.psi_stderr, "rad"),
        },
        where=term.where,
        region=term.region,
        records=seen,
        delta_bic=ripple.delta_bic,
        heldout_gain_nats=ripple.heldout_gain,
        inclusion=ripple.inclusion,
    )


def unknown_effect(trials: Trials, choice: Choice, share: float) -> Effect:
    """Return the unnamed effect that a structure of the residuals indicates.

    Args:
        share: The unexplained fraction of the misfit.
    """
    first, problem = choice.named.left[0], trials.problem
    return Effect(
        name=Verdict.UNKNOWN,
        sentence=first.sentence,
        parameters={},
        where=first.where,
        region=first.place,
        records=problem.records,
        delta_bic=-first.gain + first.count * math.log(problem.samples),
        heldout_gain_nats=choice.held.total,
        inclusion=None,
        term=False,
        share=share,
    )
