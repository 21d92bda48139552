"""Summarise a verdict in one or two sentences."""

import math
import statistics
from collections.abc import Mapping, Sequence

from ...fitting import Fit
from ...fitting.engine import nominal_of
from ...tables import scaled
from ..evidence import Choice, HeldOut, Limit, rms_of
from ..policy import Policy
from ..search import Trial
from ._diagnosis import Effect, Verdict
from ._missing import MissingFunction
from ._words import listed, number, percent, quantity, ratio, spelled


# Lower limit of standard errors that may be zero
_TINY = 1e-300


def summary_of(
    verdict: Verdict,
    effects: Sequence[Effect],
    choice: Choice,
    within: Fit,
    rig: Sequence[str],
    least: Mapping[str, Limit],
    policy: Policy,
) -> str:
    """Return the summary of a verdict.

    **Arguments:** the verdict, its effects (the unknown first), the evidence, the fit
    without terms within the tolerances of the rig, the names of the rig's parameters,
    detection limits, and the policy.
    """
    if verdict is Verdict.NONE:
        return _nothing(choice, least, policy)
    named = [effect for effect in effects if effect.term]
    parts = []
    several = len([one for one in effects if one.share is not None]) > 1
    for effect in named:
        values = ", ".join(
            f"{name} = {number(v.value, v.stderr, v.unit)}"
            for name, v in effect.parameters.items()
        )
        share = (
            f"{percent(effect.share)} of the misfit; "
            if several and effect.share
            else ""
        )
        parts.append(f"{effect.sentence} ({share}{values}; {effect.region})")
    if verdict is Verdict.EFFECT:
        moved = _moved(choice.named.best, within, rig, policy)
        return f"The model lacks {' and '.join(parts)}.{moved}"
    what = effects[0]
    acts = f"it acts like {what.sentence}, {what.region}."
    explained = sum(effect.share or 0.0 for effect in named)
    difference = choice.differing
    if difference is not None and difference.complete and not named:
        return _difference(choice).strip()
    acts += _difference(choice)
    if not explained:
        return f"The missing effect matches none of the known ones: {acts}"
    return (
        f"{percent(explained)} of the misfit is explained by {' and '.join(parts)}. "
        f"The rest ({percent(1 - explained)}) matches none of the known effects: {acts}"
    )


def _difference(choice: Choice) -> str:
    """Return a sentence about a parameter that differs between the recordings."""
    found = choice.differing
    if found is None:
        return ""
    if found.complete:
        low, high = min(found.values), max(found.values)
        return (
            f" The {spelled(found.name)} differs between the recordings, from "
            f"{low:.4g} to {quantity(f'{high:.4g}', found.unit)}; with separate "
            f"values, the residual is {ratio(found.left)} times the noise."
        )
    return (
        f" A separate {spelled(found.name)} for each recording explains "
        f"{percent(found.share)} of the squared residual above the noise."
    )


def summary_of_functions(
    functions: Sequence[MissingFunction],
    effects: Sequence[Effect],
    held: HeldOut,
    left: float,
    floor: float,
    unit: str,
) -> str:
    """Summarise unnamed functions, the named terms, and the gain of the fit.

    **Arguments:** the functions, all effects, the held-out data, the remaining residual
    in units of the noise, the noise and its unit.
    """
    named = [effect.sentence for effect in effects if effect.term]
    beside = f" in addition to {listed(named)}" if named else ""
    words = " and ".join(one.words for one in functions)
    found = f"The model lacks an unnamed effect{beside}: {words}."
    if held.after < held.before:
        factor, unit = scaled(unit, held.before * floor)
        before, after = (factor * floor * one for one in (held.before, held.after))
        return (
            f"{found} Fitted together with the rig parameters, it reduces the error on "
            f"held-out flights from {before:.3g} to "
            f"{quantity(f'{after:.3g}', unit)}; the noise is {factor * floor:.3g}."
        )
    return (
        f"{found} Fitted together with the rig parameters, it explains the recordings "
        f"to within {left:.3g} times the noise; part of the data does not determine "
        "it well enough to predict the rest."
    )


def _nothing(choice: Choice, least: Mapping[str, Limit], policy: Policy) -> str:
    fitted, unseen = rms_of(choice.named.best.fit), choice.held.after
    tail = ""
    if least:
        # the first of the effects that the rig parameters cannot imitate well
        usual = statistics.median(one.confusion for one in least.values())
        clear = {name: one for name, one in least.items() if one.confusion <= usual}
        name, limit = next(iter((clear or least).items()))
        size = quantity(f"{limit.size:.2g}", limit.unit)
        tail = f" For example, {name} = {size} would have been detected."
    if fitted > policy.as_noise:
        return (
            "No missing physics common to the recordings was detected. However, the "
            "model does not explain the recordings down to the sensor noise: the "
            f"residual is {ratio(fitted)} times the noise and differs from recording "
            f"to recording.{_difference(choice)}{tail}"
        )
    if unseen > policy.as_noise:
        tail = (
            f"{tail} However, part of the data does not determine the parameters "
            "well enough to predict the rest: the residual is "
            f"{ratio(unseen)} times the noise."
        )
    return (
        "No missing physics was detected: with its parameters fitted within their "
        f"tolerances, the model explains the recordings down to the sensor noise.{tail}"
    )


def _moved(best: Trial, within: Fit, rig: Sequence[str], policy: Policy) -> str:
    """Return a sentence on the parameter that compensated most for the missing physics.

    The comparison is with a fit without the terms, within the tolerances of the rig.
    """
    if not best.names:
        return ""
    moved = {
        one.label: abs(within[one.label].value - one.value) / max(one.stderr, _TINY)
        for one in best.fit.estimates
        if one.name in rig
    }
    if not moved:
        return ""
    label = max(moved, key=lambda one: moved[one])
    if moved[label] < policy.moved_errors:
        return ""
    one = best.fit[label]
    where = "" if one.record is None else f" of {one.record}"
    return (
        f" Without {'it' if len(best.names) == 1 else 'them'}, the fit would have "
        f"shifted {spelled(one.name)}{where} from {one.value:.5g} to "
        f"{within[label].value:.5g}{_limit(within, label)}."
    )


def _limit(within: Fit, label: str) -> str:
    """Return words that say that a value is at the limit of its tolerance."""
    one, problem = within[label], within.problem
    parameter = problem.parameter(one.name)
    nominal = nominal_of(problem, problem.names.index(one.name))
    ends = (nominal - parameter.tolerance, nominal + parameter.tolerance)
    at_limit = any(math.isclose(one.value, end) for end in ends)
    return ", the limit of its tolerance" if at_limit else ""
