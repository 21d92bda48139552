"""Write the diagnosis of a choice: verdict, effects, alternatives, caveats, numbers."""

import math
from collections.abc import Iterator, Mapping

from ...fitting import Fit
from ...fitting.engine import nominal_of
from ..evidence import (
    Choice,
    limits,
    misfit_by_part,
    Needs,
    Ripple,
    rms_of,
    Shares,
    shares,
    visited_states,
)
from ..policy import Policy
from ..search import Free, Missing, Question, Trials
from ..terms import Value, watching
from ._alternatives import (
    alternatives_of,
    alternatives_to_functions,
    fitted_alternatives,
    rival_name,
)
from ._caveats import (
    by_chance,
    Caveat,
    caveats_of,
    decoy_explains,
    differs,
    functions_fall_short,
    functions_not_predictive,
    functions_tie,
    may_differ,
    model_errors,
    not_predictive,
    out_of_time,
    small_remainder,
)
from ._close_forms import close_forms
from ._diagnosis import Diagnosis, Verdict
from ._direction import in_both_directions
from ._effects import (
    drive_effect,
    missing_effects,
    term_effects,
    unknown_effect,
    with_speed,
)
from ._missing import missing_functions, named_function
from ._stated_noise import noisier_than_stated, quieter_than_stated
from ._summary import summary_of, summary_of_functions
from ._units_in_doubt import units_in_doubt


def diagnosis_of(
    case: str,
    question: Question,
    trials: Trials,
    choice: Choice,
    ripple: Ripple | None,
) -> Diagnosis:
    """Report the choice and its evidence in words and numbers."""
    policy, held, best = trials.policy, choice.held, choice.named.best
    if choice.unnamed.found is not None and choice.unnamed.needs is not None:
        return _of_functions(
            case,
            question,
            trials,
            choice,
            choice.unnamed.found,
            choice.unnamed.needs,
            ripple,
        )
    divided = _shares_of(trials, choice)
    effects = [
        with_speed(effect, question.fitted_speed)
        for effect in term_effects(trials, choice, divided.of)
    ]
    if ripple is not None and ripple.significant(len(trials.terms) + 1, policy):
        effects.append(drive_effect(ripple, policy))
    named = bool(effects)
    verdict, caveats = _verdict(choice, named, policy.small)
    if verdict is Verdict.UNKNOWN:
        effects.insert(0, unknown_effect(trials, choice, divided.left))
    others = fitted_alternatives(trials, choice)[: policy.alternatives]
    ties = [trial for trial in others if abs(trial.bic - best.bic) < policy.tie]
    caveats += _of_search(question, trials, choice)
    caveats += caveats_of(trials, choice, ties, bool(effects))
    model = question.problem.model
    floor = float(model.sensors[watching(model)].floor)
    least = limits(trials, best)
    within = choice.before.fit
    names = [effect.name for effect in effects]
    return Diagnosis(
        case=case,
        verdict=verdict,
        effects=tuple(effects),
        alternatives=alternatives_of(trials, choice),
        heldout_before=held.before * floor,
        heldout_after=held.after * floor,
        noise_floor=floor,
        unit=question.unit,
        rig=_rig_values(question, choice.named.best.fit, choice.named.deviation),
        summary=summary_of(
            verdict, effects, choice, within, question.rig, least, policy
        ),
        before=choice.before.fit,
        after=best.fit,
        left_before=tuple(choice.named.left_before),
        left_after=tuple(choice.named.left_after),
        unseen=held.residuals,
        ripple=ripple,
        pulls=_pulls(question, within, best.fit),
        limits={
            name: Value(one.size, one.stderr, one.unit)
            for name, one in least.items()
            if name not in names
        },
        hides={name: one.hidden for name, one in least.items()},
        caveats=tuple(caveats),
        policy=policy,
        misfit=misfit_by_part(choice.before.fit, policy),
        differing=choice.differing,
    )


def _shares_of(trials: Trials, choice: Choice) -> Shares:
    """Return the fraction of the misfit that each named term explains, and the
    unexplained fraction.
    """
    best, before = choice.named.best, choice.before
    instead = {one.term: one.lost for one in choice.named.beyond if one.term}
    lost = {
        name: instead.get(
            name,
            trials.known.get(best.names - {name}, before).fit.cost - best.fit.cost,
        )
        for name in best.names
    }
    left = max((one.gain for one in choice.named.left), default=0.0)
    return shares(before.fit, best.fit, lost, left, trials.policy)


def _of_functions(
    case: str,
    question: Question,
    trials: Trials,
    choice: Choice,
    missing: Missing,
    needs: Needs,
    ripple: Ripple | None,
) -> Diagnosis:
    """Return the diagnosis of a choice that contains unnamed functions."""
    policy, held, found = trials.policy, choice.held, missing.fit
    positions, velocities, _, _ = visited_states(question.problem).ranges(policy)
    bare = choice.before
    close = close_forms(
        missing,
        [rival.missing for rival in choice.unnamed.rivals],
        needs.lost,
        policy.small,
    )
    functions = missing_functions(missing, velocities, positions, close, policy)
    divided = shares(bare.fit, found, needs.lost, 0.0, policy)
    effects = missing_effects(trials, functions, missing, needs, choice, divided)
    if ripple is not None and ripple.significant(len(trials.terms) + 1, policy):
        effects.append(drive_effect(ripple, policy))
    model = question.problem.model
    floor = float(model.sensors[watching(model)].floor)
    within = bare.fit
    return Diagnosis(
        case=case,
        verdict=Verdict.UNKNOWN,
        effects=tuple(effects),
        alternatives=alternatives_to_functions(trials, missing, choice.unnamed.rivals),
        heldout_before=held.before * floor,
        heldout_after=held.after * floor,
        noise_floor=floor,
        unit=question.unit,
        rig=_rig_values(question, found, needs.deviation),
        summary=summary_of_functions(
            functions, effects, held, rms_of(found), floor, question.unit
        ),
        before=bare.fit,
        after=found,
        left_before=tuple(choice.named.left_before),
        left_after=(),
        unseen=held.residuals,
        ripple=ripple,
        pulls=_pulls(question, within, found),
        limits={},
        hides={},
        caveats=(
            *_of_search(question, trials, choice),
            *_doubts_of(choice, missing, policy),
        ),
        policy=policy,
        missing=functions,
        misfit=misfit_by_part(bare.fit, policy),
        differing=choice.differing,
    )


def _of_search(question: Question, trials: Trials, choice: Choice) -> Iterator[Caveat]:
    """Return caveats on the conditions of the search, whatever it found."""
    yield from noisier_than_stated(question)
    yield from quieter_than_stated(question, choice.fit, trials.policy)
    yield from model_errors(question, choice)
    if choice.rejected is not None:
        found = choice.rejected.functions
        parts = [named_function(found.fit, part) for part in found.functions]
        yield not_predictive(choice.rejected, " and a ".join(parts))
    yield from map(by_chance, choice.unnamed.by_chance)
    yield from units_in_doubt(question, choice, trials.policy)
    yield from out_of_time(trials)


def _doubts_of(choice: Choice, missing: Missing, policy: Policy) -> Iterator[Caveat]:
    """Return caveats if the functions leave a residual above the noise, do not predict
    the held-out data, or explain no more than other functions do.
    """
    left, held = missing.fit, choice.held
    for rival in choice.unnamed.rivals:
        if rival.share > 1 - policy.confidence:
            yield functions_tie(rival_name(rival), rival)
    direction = choice.named.direction
    forms = [part.form for part in missing.functions if isinstance(part, Free)]
    if direction is not None and direction.form.name in forms:
        if not missing.names and direction.worse >= -policy.tie:
            yield in_both_directions(direction)
    share = max((share for _, share in missing.decoys), default=0.0)
    if share > policy.decoy:
        yield decoy_explains(share)
    if choice.differing is not None:
        parts = [
            p for p in missing.functions if choice.differing.name in p.coefficients
        ]
        called = [f"coefficient of the {named_function(left, p)}" for p in parts]
        yield differs(choice.differing, policy, *called)
    if choice.tied is not None:
        yield may_differ(choice.tied, policy)
    if rms_of(left) > policy.as_noise:
        yield functions_fall_short(rms_of(left))
    elif held.after > policy.as_noise:
        yield functions_not_predictive(held)


def _verdict(choice: Choice, named: bool, small: float) -> tuple[Verdict, list[Caveat]]:
    """Return the verdict, and a caveat if a named effect leaves a small residual."""
    if not choice.named.left:
        return (Verdict.EFFECT if named else Verdict.NONE), []
    left = max(one.gain for one in choice.named.left)
    explained = choice.before.fit.cost - choice.named.best.fit.cost
    if choice.named.best.names and left < small * explained:
        return Verdict.EFFECT, [small_remainder(choice, left / explained)]
    return Verdict.UNKNOWN, []


def _rig_values(
    question: Question, fitted: Fit, deviation: Mapping[str, float]
) -> dict[str, Value]:
    """Return the fitted parameters of the system as they are reported."""
    found = {}
    for one in fitted.estimates:
        if one.name not in question.rig:
            continue
        # some bootstrap samples contain no information on a parameter
        most = fitted.problem.parameter(one.name).prior_stderr
        stderr = max(one.stderr, min(deviation.get(one.name, 0.0), most))
        if question.fitted_speed is not None:
            more = question.fitted_speed.errors.get(one.label, 0.0)
            stderr = math.hypot(stderr, more)
        value, unit = one.value, one.unit
        if one.name in question.shown:
            shown = question.shown[one.name]
            unit = shown.unit
            value, stderr = value / shown.divisor, stderr / shown.divisor
        found[_shown_name(question, one.name, one.label)] = Value(value, stderr, unit)
    return found


def _shown_name(question: Question, name: str, label: str) -> str:
    """Return the name under which a parameter of the system is reported."""
    shown = question.shown.get(name)
    return label if shown is None else shown.name


def _pulls(
    question: Question, within: Fit, best: Fit
) -> dict[str, tuple[float, float]]:
    """Return the deviations of parameters from nominal, in units of their tolerances:
    without and with the terms.
    """
    found, problem = {}, question.problem
    for one in best.estimates:
        if one.name not in question.rig:
            continue
        place = problem.names.index(one.name)
        nominal = nominal_of(problem, place)
        size = problem.parameter(one.name).size(nominal)
        before, after = within[one.label].value, one.value
        name = _shown_name(question, one.name, one.label)
        found[name] = (before - nominal) / size, (after - nominal) / size
    return found
