"""Caveats that qualify a verdict."""

from collections.abc import Iterator

from ..evidence import (
    Choice,
    Differing,
    HeldOut,
    not_shared,
    Outside,
    Rejected,
    Rival,
    rms_of,
)
from ..policy import Policy
from ..search import Question, Shuffled, Trial, Trials
from ._caveat import Caveat, Reason
from ._direction import in_one_direction
from ._words import listed, number, percent, quantity, ratio, spelled


def caveats_of(
    trials: Trials, choice: Choice, ties: list[Trial], named: bool
) -> Iterator[Caveat]:
    """Return all caveats except the one about the verdict itself.

    **Arguments:** the trials, the choice, other subsets that are equally good, and
    whether any effect is named.
    """
    for name, share in choice.named.doubtful:
        yield _in_doubt(trials, name, share)
    for name, share in choice.named.masked:
        yield _masked(choice, name, share)
    for name, sentence in choice.named.imitating:
        yield _imitating(name, sentence)
    apart = not_shared(choice, trials.policy)
    for name, share in choice.named.needed:
        yield _named_in_doubt(trials, name, share, bool(apart))
    for outside in choice.named.beyond:
        yield _beyond(outside)
    if not trials.settled(choice.named.found):
        yield _far(trials)
    for trial in ties:
        yield _tie(choice.named.best, trial)
    direction = choice.named.direction
    if direction is not None and direction.worse <= trials.policy.tie:
        yield in_one_direction(direction)
    if apart and not (choice.differing is not None and choice.differing.complete):
        yield Caveat(
            Reason.NOT_SHARED,
            "A discrepancy that differs from recording to recording remains "
            f"({apart[0].sentence}). Its cause is not common to the recordings; check "
            "how they were made.",
        )
    if choice.differing is not None:
        yield differs(choice.differing, trials.policy)
    if choice.held.after > trials.policy.as_noise:
        yield above_noise(choice.held, named)


def differs(found: Differing, policy: Policy, called: str = "") -> Caveat:
    """Return the caveat that a parameter differs from recording to recording.

    **Arguments:** `called`: a description of the parameter, if its name means nothing
    to a reader.
    """
    return Caveat(
        Reason.DIFFERING,
        f"The recordings differ: a separate {called or spelled(found.name)} for each "
        "of them "
        f"({_values_of(found, policy)}) explains {percent(found.share)} of the squared "
        "residual above the noise and leaves a residual of "
        f"{ratio(found.left)} times the noise. The quantity that this parameter "
        "represents has changed between the recordings.",
    )


def may_differ(found: Differing, policy: Policy) -> Caveat:
    """Return the caveat that separate values explain the data as well as a function
    does.
    """
    return Caveat(
        Reason.TIE,
        f"A separate {spelled(found.name)} for each recording "
        f"({_values_of(found, policy)}) would explain the data as well as the function "
        "does. Make a recording in which the motion varies over the ranges of several "
        "of these recordings: only the function would predict it.",
    )


def _values_of(found: Differing, policy: Policy) -> str:
    """Return the separate values of a parameter, or their range, in words."""
    values, unit = found.values, found.unit
    if len(values) > policy.several:
        return f"from {min(values):.4g} to {quantity(f'{max(values):.4g}', unit)}"
    return ", ".join(
        f"{name} {number(value, stderr, unit)}"
        for name, value, stderr in zip(found.records, values, found.stderr)
    )


def not_predictive(found: Rejected, functions: str) -> Caveat:
    """Return the caveat that functions explain the recordings only where they were
    fitted.
    """
    held = found.held
    return Caveat(
        Reason.NOT_PREDICTIVE,
        f"A model with a {functions} fits the recordings but does not predict held-out "
        f"flights: the residual there is {ratio(held.after)} times the noise, compared "
        f"with {ratio(found.named.after)} times for the model without functions. This "
        "explanation is therefore not reported. Record more motions under the same "
        "conditions.",
    )


def model_errors(question: Question, choice: Choice) -> Iterator[Caveat]:
    """Return caveats for a fit that is so poor that errors of the model were allowed
    for.
    """
    whole, unit = choice.whole, question.unit
    errors = question.model_errors
    worst = sorted(errors, key=lambda each: each.residual / each.stated)[-1:]
    for one in worst:
        more = f", and deviations below {one.used:.3g} were treated as noise"
        yield Caveat(
            Reason.MODEL_ERROR,
            "The errors of the model are large: on single pieces of flight, the "
            f"residual of the textbook model in `{one.channel}` is {one.residual:.3g}, "
            f"{ratio(one.residual / one.stated)} times the noise ({one.stated:.3g}). "
            "The pieces of a flight were therefore allowed to join inexactly"
            f"{more if one.used > one.stated else ''}. All residuals of this report "
            "refer to single pieces.",
        )
    if whole is not None:
        yield Caveat(
            Reason.MODEL_ERROR,
            "Fitted to complete flights, the textbook model has an rms residual of "
            f"{quantity(f'{whole.before:.3g}', unit)} and the chosen model one of "
            f"{quantity(f'{whole.after:.3g}', unit)}.",
        )


def out_of_time(trials: Trials) -> Iterator[Caveat]:
    """Return the caveat that candidates were left out because the time was over."""
    if trials.clock.stopped:
        yield Caveat(
            Reason.TIME,
            f"The search was ended after {trials.policy.minutes:.3g} minutes: not all "
            "candidates were tried. To allow more time, set `minutes` of the policy "
            "(`--minutes` on the command line).",
        )


def above_noise(held: HeldOut, named: bool) -> Caveat:
    """Return the caveat that held-out data are not predicted to within the noise."""
    if named and held.after > held.before:
        return poor_prediction(held)
    return Caveat(
        Reason.ABOVE_NOISE,
        f"On held-out data the residual of the model is {ratio(held.after)} times the "
        f"sensor noise ({ratio(held.before)} times for the textbook model): the model "
        "is incomplete, or the noise is larger than stated.",
    )


def poor_prediction(held: HeldOut) -> Caveat:
    """Return the caveat that part of the data does not determine the parameters needed
    to predict the rest.
    """
    return Caveat(
        Reason.POOR_PREDICTION,
        "Part of the data does not determine the parameters well enough to predict "
        f"the rest: the residual is {ratio(held.after)} times the noise, compared with "
        f"{ratio(held.before)} times for the textbook model. Record at more speeds.",
    )


def small_remainder(choice: Choice, share: float) -> Caveat:
    """Return the caveat that a named effect leaves a small residual."""
    first = choice.named.left[0]
    return Caveat(
        Reason.SMALL_REMAINDER,
        f"A small discrepancy remains ({first.sentence}, {first.place}); it amounts to "
        f"{percent(share)} of the explained misfit. The form of the named effect may "
        "be slightly different.",
        tuple(sorted(choice.named.best.names)),
    )


def functions_fall_short(left: float) -> Caveat:
    """Return the caveat that unnamed functions leave a residual above the noise."""
    return Caveat(
        Reason.POOR_FIT,
        f"With these functions, the residual of the fit is still {ratio(left)} times "
        "the noise: they are only part of the missing physics, and their form is "
        "approximate.",
    )


def functions_not_predictive(held: HeldOut) -> Caveat:
    """Return the caveat that part of the data does not determine unnamed functions that
    explain all data.
    """
    return Caveat(
        Reason.POOR_PREDICTION,
        "Fitted to all data, the model leaves only noise, but part of the data does "
        "not determine its functions well enough to predict the rest: on held-out "
        f"data, the residual is {ratio(held.after)} times the noise, compared with "
        f"{ratio(held.before)} times for the textbook model. Record more motions of "
        "this kind.",
    )


def functions_tie(name: str, rival: Rival) -> Caveat:
    """Return the caveat that another function or form explains about as much."""
    return Caveat(
        Reason.TIE,
        f"These recordings do not distinguish the function from {name}, which would "
        f"be chosen in {rival.share:.0%} of the bootstrap samples. Record motions that "
        "visit more of the states in which the two differ.",
        tuple(sorted(rival.missing.names)),
    )


def decoy_explains(share: float) -> Caveat:
    """Return the caveat that a decoy acting at the wrong times also explains much."""
    return Caveat(
        Reason.DECOY,
        "Evaluated along the time-reversed motion, the function would explain "
        f"{share:.0%} of what it explains along the measured motion, so these "
        "recordings hardly show when the force acts. Record less periodic motions.",
    )


def by_chance(one: Shuffled) -> Caveat:
    """Return the caveat that a force explains no more than one of its knockoffs."""
    return Caveat(
        Reason.CHANCE,
        f"A force that depends on {listed(one.arguments)} fits the recordings, but of "
        f"{len(one.shares)} functions of the same kind that take their arguments at "
        f"other moments, the best explains {percent(one.best)} of what this force "
        "explains. The force is therefore not reported. Record more motions under the "
        "same conditions.",
    )


def _in_doubt(trials: Trials, name: str, share: float) -> Caveat:
    return Caveat(
        Reason.IN_DOUBT,
        f"A term for {spelled(name)} improves the fit, but "
        f"{_against(trials, share)}; record more data before relying on it.",
        (name,),
    )


def _beyond(outside: Outside) -> Caveat:
    """Return the caveat on a parameter beyond its tolerance or a term in its place."""
    one, name = outside.parameter, outside.term
    label = spelled(one.name)
    said = number(one.value, one.stderr, one.unit)
    ends = f"{one.low:.4g} to {quantity(f'{one.high:.4g}', one.unit)}"
    if not name:
        return Caveat(
            Reason.BEYOND_TOLERANCE,
            f"The fitted {label} is {said}, outside its tolerance ({ends}): correct "
            "the rig file if this value is possible, or look for an effect that acts "
            "like it.",
        )
    return Caveat(
        Reason.BEYOND_TOLERANCE,
        f"The recordings determine only the sum of {label} and "
        f"{spelled(name)}, {said}. The tolerance allows {ends}; the excess is "
        "attributed to the effect, so the strength of the effect is only as accurate "
        "as the tolerance.",
        (name,),
    )


def _masked(choice: Choice, name: str, share: float) -> Caveat:
    return Caveat(
        Reason.MASKED,
        f"A term for {spelled(name)} would explain only {share:.1g} of the misfit "
        f"explained by {listed(sorted(choice.named.best.names))}; the smoothing of dry "
        "friction at zero velocity may leave this much unexplained.",
        (name,),
    )


def _imitating(name: str, sentence: str) -> Caveat:
    return Caveat(
        Reason.IMITATING,
        f"A term for {spelled(name)} improves the fit, but it would hardly be needed "
        f"in addition to the remaining effect, which acts like {sentence}.",
        (name,),
    )


def _named_in_doubt(trials: Trials, name: str, share: float, apart: bool) -> Caveat:
    """Return the caveat of a term that the bootstrap does not confirm; `apart`: whether
    a discrepancy that differs between recordings remains.
    """
    common = " common to all recordings" if apart else ""
    return Caveat(
        Reason.NAMED_IN_DOUBT,
        f"The term for {spelled(name)} is named because no discrepancy{common} "
        f"remains with it, but {_against(trials, share)}; record more data to "
        "determine its strength.",
        (name,),
    )


def _against(trials: Trials, share: float) -> str:
    """Return the evidence against a term that improves the fit in a fraction of the
    bootstrap samples.
    """
    if share >= trials.policy.confidence:
        return "its strength varies so much between blocks that it might be zero"
    return f"it improves the fit in only {share:.0%} of the bootstrap samples"


def _far(trials: Trials) -> Caveat:
    """Return the caveat that even the best fit is poor."""
    least = min(trials.known.values(), key=lambda trial: trial.fit.cost)
    named = listed(sorted(least.names)) if least.names else "none of them"
    return Caveat(
        Reason.POOR_FIT,
        "No subset of the known effects fits these recordings well: the residual "
        f"of the best fit, with {named}, is {ratio(rms_of(least.fit))} times the "
        "noise. The stated form and location of the missing physics are approximate.",
        tuple(sorted(least.names)),
    )


def _tie(best: Trial, other: Trial) -> Caveat:
    names = tuple(sorted(other.names))
    written = spelled("+".join(names) or "the textbook model")
    return Caveat(
        Reason.TIE,
        f"These recordings cannot distinguish {listed(sorted(best.names))} from "
        f"{written}: the BIC differs by only {other.bic - best.bic:.1f}. Record "
        "motions of larger and smaller amplitude, at speeds further apart.",
        names,
    )
