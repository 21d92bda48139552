"""The diagnosis of a choice: verdict, effects, alternatives, caveats, numbers."""

from collections.abc import Iterator, Mapping

from ...fitting import Fit
from ..evidence import Choice, HeldOut, limits, Needs, ranges_of, Ripple, rms_of
from ..policy import Policy
from ..search import Missing, Question, Trial, Trials, within_tolerances
from ..terms import Value
from ._caveats import (
    Caveat,
    caveats_of,
    functions_fall_short,
    poor_prediction,
    small_remainder,
)
from ._diagnosis import Alternative, Diagnosis, Verdict
from ._effects import (
    drive_effect,
    missing_effects,
    term_effects,
    unknown_effect,
)
from ._missing import missing_functions
from ._summary import summary_of, summary_of_functions


def diagnosis_of(
    case: str,
    question: Question,
    trials: Trials,
    choice: Choice,
    ripple: Ripple | None,
) -> Diagnosis:
    """Put into words and numbers what was chosen, and why."""
    policy, held, best = trials.policy, choice.held, choice.best
    if choice.missing is not None and choice.needs is not None:
        return _of_functions(
            case, question, trials, choice, choice.missing, choice.needs, ripple
        )
    effects = term_effects(trials, choice)
    if ripple is not None and ripple.significant(len(trials.terms) + 1, policy):
        effects.append(drive_effect(ripple, policy))
    named = bool(effects)
    verdict, caveats = _verdict(choice, named, policy.small)
    if verdict is Verdict.UNKNOWN:
        effects.insert(0, unknown_effect(trials, choice))
    others = _others(trials, best, policy.alternatives)
    ties = [trial for trial in others if abs(trial.bic - best.bic) < policy.tie]
    caveats += caveats_of(trials, choice, ties, bool(effects))
    floor = float(next(iter(question.problem.model.sensors.values())).floor)
    least = limits(trials, best)
    within = within_tolerances(choice.before.fit, best.fit, question.rig, policy)
    names = [effect.name for effect in effects]
    return Diagnosis(
        case,
        verdict,
        tuple(effects),
        tuple(_alternative(trial, best) for trial in others),
        held.before * floor,
        held.after * floor,
        floor,
        question.unit,
        _rig_values(question, choice.best.fit, choice.deviation),
        summary_of(verdict, effects, choice, within, question.rig, least, policy),
        choice.before.fit,
        best.fit,
        tuple(choice.left_before),
        tuple(choice.left_after),
        held.residuals,
        ripple,
        _pulls(question, within, best.fit),
        {
            name: Value(one.size, one.stderr, one.unit)
            for name, one in least.items()
            if name not in names
        },
        {name: one.hidden for name, one in least.items()},
        tuple(caveats),
        policy,
    )


def _of_functions(
    case: str,
    question: Question,
    trials: Trials,
    choice: Choice,
    missing: Missing,
    needs: Needs,
    ripple: Ripple | None,
) -> Diagnosis:
    """The diagnosis where functions without a name were found."""
    policy, held, found = trials.policy, choice.held, missing.fit
    positions, velocities, _, _ = ranges_of(question.problem, policy)
    functions = missing_functions(missing, velocities, positions, policy.shape_points)
    bare = choice.before
    effects = missing_effects(trials, functions, missing, needs, choice)
    if ripple is not None and ripple.significant(len(trials.terms) + 1, policy):
        effects.append(drive_effect(ripple, policy))
    floor = float(next(iter(question.problem.model.sensors.values())).floor)
    others = sorted(trials.known.values(), key=lambda trial: trial.bic)
    within = within_tolerances(bare.fit, found, question.rig, policy)
    return Diagnosis(
        case,
        Verdict.UNKNOWN,
        tuple(effects),
        tuple(
            Alternative(one.name, trial.bic - missing.score, one.terms)
            for trial in others[: policy.alternatives]
            for one in [_alternative(trial, trial)]
        ),
        held.before * floor,
        held.after * floor,
        floor,
        question.unit,
        _rig_values(question, found, needs.deviation),
        summary_of_functions(
            functions, effects, held, rms_of(found), floor, question.unit
        ),
        bare.fit,
        found,
        tuple(choice.left_before),
        (),
        held.residuals,
        ripple,
        _pulls(question, within, found),
        {},
        {},
        tuple(_doubts_of(missing, held, policy)),
        policy,
        functions,
    )


def _doubts_of(missing: Missing, held: HeldOut, policy: Policy) -> Iterator[Caveat]:
    """That what was found does not explain everything, or not what it has not seen."""
    left = rms_of(missing.fit)
    if left > policy.as_noise:
        yield functions_fall_short(left)
    if held.after > max(held.before, policy.as_noise):
        yield poor_prediction(held)


def _verdict(choice: Choice, named: bool, small: float) -> tuple[Verdict, list[Caveat]]:
    """The verdict, and a caveat where a named effect leaves a small share."""
    if not choice.unexplained:
        return (Verdict.EFFECT if named else Verdict.NONE), []
    left = max(one.gain for one in choice.unexplained)
    explained = choice.before.fit.cost - choice.best.fit.cost
    if choice.best.names and left < small * explained:
        return Verdict.EFFECT, [small_remainder(choice, left / explained)]
    return Verdict.UNKNOWN, []


def _others(trials: Trials, best: Trial, most: int) -> list[Trial]:
    """Other subsets, the best first; a superset is the same explanation with more."""
    found = [
        trial
        for names, trial in trials.known.items()
        if names != best.names and not names > best.names
    ]
    return sorted(found, key=lambda trial: trial.bic - best.bic)[:most]


def _alternative(trial: Trial, best: Trial) -> Alternative:
    terms = tuple(sorted(trial.names))
    return Alternative("+".join(terms) or "none", trial.bic - best.bic, terms)


def _rig_values(
    question: Question, fitted: Fit, deviation: Mapping[str, float]
) -> dict[str, Value]:
    """Fitted parameters of the system, as they are reported."""
    found = {}
    for one in fitted.estimates:
        if one.name not in question.rig:
            continue
        stderr = max(one.stderr, deviation.get(one.name, 0.0))
        name, value, unit = one.name, one.value, one.unit
        if name in question.shown:
            shown = question.shown[name]
            name, unit = shown.name, shown.unit
            value, stderr = value / shown.divisor, stderr / shown.divisor
        found[name] = Value(value, stderr, unit)
    return found


def _pulls(
    question: Question, within: Fit, best: Fit
) -> dict[str, tuple[float, float]]:
    """Return the distances of parameters from nominal, without and with the terms."""
    found, problem = {}, question.problem
    for name in question.rig:
        place = problem.names.index(name)
        nominal = float(problem.start.values[0, place])
        size = problem.parameter(name).size(nominal)
        before, after = within[name].value, best[name].value
        found[name] = (before - nominal) / size, (after - nominal) / size
    return found
