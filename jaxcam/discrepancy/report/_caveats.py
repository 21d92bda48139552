"""Caveats that a reader must know before relying on a verdict."""

import dataclasses
import enum
from collections.abc import Iterator

from ..evidence import Choice, HeldOut, Outside, Rival, rms_of
from ..search import Question, Trial, Trials
from ._words import listed, number, quantity


class Reason(enum.StrEnum):
    """The reason of a caveat; equal to its name as a string."""

    SMALL_REMAINDER = "small remainder"
    IN_DOUBT = "in doubt"
    MASKED = "masked by a corner"
    NAMED_IN_DOUBT = "named in doubt"
    FAR_FROM_DATA = "far from the data"
    TIE = "tie"
    NOT_SHARED = "not shared by the records"
    POOR_PREDICTION = "poor prediction"
    ABOVE_NOISE = "above the noise"
    BEYOND_TOLERANCE = "beyond tolerance"
    NOISIER = "noisier than stated"
    SET_ASIDE = "record set aside"


@dataclasses.dataclass(frozen=True)
class Caveat:
    """One reservation about a verdict."""

    reason: Reason
    """A `Reason`."""
    sentence: str
    """The reservation in words, also by `str`."""
    terms: tuple[str, ...] = ()
    """Names of the terms concerned, if any."""

    def __str__(self) -> str:
        return self.sentence


def caveats_of(
    trials: Trials, choice: Choice, ties: list[Trial], named: bool
) -> Iterator[Caveat]:
    """All but that of the verdict itself.

    **Arguments:** the trials, what was chosen, other subsets that are as good, and
    whether anything is named.
    """
    for name, share in choice.doubtful:
        yield _in_doubt(trials, name, share)
    for name, share in choice.masked:
        yield _masked(choice, name, share)
    for name, share in choice.needed:
        yield _named_in_doubt(trials, name, share)
    for outside in choice.beyond:
        yield _beyond(outside)
    if not trials.settled(choice.found):
        yield _far(trials)
    for trial in ties:
        yield _tie(choice.best, trial)
    apart = [
        s for s in choice.left_after if s.gain > s.threshold and s.predicted_gain <= 0
    ]
    if apart:
        yield Caveat(
            Reason.NOT_SHARED,
            f"Something that differs from record to record is left over "
            f"({apart[0].sentence}): it is no physics that they share; look at how "
            f"they were recorded.",
        )
    held = choice.held
    if held.after > trials.policy.as_noise:
        yield above_noise(held, named)


def noisier_than_stated(question: Question) -> Iterator[Caveat]:
    """Caveats for channels whose stated noise is too small."""
    for one in question.noisier:
        yield Caveat(
            Reason.NOISIER,
            f"The recordings show a noise of {one.seen:.3g} in `{one.channel}`, "
            f"{one.seen / one.stated:.2g} times what is stated ({one.stated:.3g}); the "
            f"larger figure was used.",
        )


def above_noise(held: HeldOut, named: bool) -> Caveat:
    """Caveat: held-out data are not predicted to within the noise; possible reasons."""
    if named and held.after > held.before:
        return poor_prediction(held)
    return Caveat(
        Reason.ABOVE_NOISE,
        f"On held-out data the model still misses by {held.after:.2g} times the noise "
        f"of the sensors (the textbook model: {held.before:.2g}): it is not complete, "
        f"or the noise is larger than stated.",
    )


def poor_prediction(held: HeldOut) -> Caveat:
    """Caveat: a part of the records does not determine what the others need."""
    return Caveat(
        Reason.POOR_PREDICTION,
        "A part of the records does not pin the parameters down well enough to "
        f"predict the others: it misses by {held.after:.2g} times the noise, the "
        f"textbook model by {held.before:.2g}. Record at more speeds.",
    )


def small_remainder(choice: Choice, share: float) -> Caveat:
    """Caveat: a named effect leaves a small share of what it explains."""
    first = choice.unexplained[0]
    return Caveat(
        Reason.SMALL_REMAINDER,
        f"Something small is left over ({first.sentence}, {first.place}): {share:.1%} "
        f"of what was explained. The effect may have a slightly different form.",
        tuple(sorted(choice.best.names)),
    )


def functions_fall_short(left: float) -> Caveat:
    """Caveat: functions without a name do not explain the records to the noise."""
    return Caveat(
        Reason.FAR_FROM_DATA,
        f"With these functions the fit still misses by {left:.2g} times the noise: "
        f"they are a part of what is missing, and their form is rough.",
    )


def functions_tie(name: str, rival: Rival) -> Caveat:
    """That another function, or another form, explains about as much."""
    return Caveat(
        Reason.TIE,
        f"These records do not tell it from {name}, which would be chosen in "
        f"{rival.share:.0%} of the redrawn sets of stretches. Record motions that "
        f"visit more of the states between which the two differ.",
        tuple(sorted(rival.missing.names)),
    )


def _in_doubt(trials: Trials, name: str, share: float) -> Caveat:
    return Caveat(
        Reason.IN_DOUBT,
        f"A term for {name.replace('_', ' ')} gains something, but "
        f"{_against(trials, share)}; record more before you believe it.",
        (name,),
    )


def _beyond(outside: Outside) -> Caveat:
    """Caveat: a parameter is outside its tolerance, or a term was named instead."""
    one, name = outside.parameter, outside.term
    label = one.name.replace("_", " ")
    said = number(one.value, one.stderr, one.unit)
    ends = f"{one.low:.4g} to {quantity(f'{one.high:.4g}', one.unit)}"
    if not name:
        return Caveat(
            Reason.BEYOND_TOLERANCE,
            f"The fitted {label} is {said}, outside its tolerance ({ends}): correct "
            f"the rig file if it may be so, or look for something that acts like it.",
        )
    return Caveat(
        Reason.BEYOND_TOLERANCE,
        f"The records show the sum of {label} and {name.replace('_', ' ')}, {said}. "
        f"The tolerance allows {ends}; what is beyond it is named, and its strength is "
        f"known only as well as the tolerance.",
        (name,),
    )


def _masked(choice: Choice, name: str, share: float) -> Caveat:
    return Caveat(
        Reason.MASKED,
        f"A term for {name.replace('_', ' ')} would explain {share:.1g} of what "
        f"{listed(sorted(choice.best.names))} explains: no more than the numerical "
        f"form of dry friction, whose corner is smoothed, may leave over.",
        (name,),
    )


def _named_in_doubt(trials: Trials, name: str, share: float) -> Caveat:
    return Caveat(
        Reason.NAMED_IN_DOUBT,
        f"The term for {name.replace('_', ' ')} is named because nothing is left over "
        f"with it, but {_against(trials, share)}; record more to know its strength.",
        (name,),
    )


def _against(trials: Trials, share: float) -> str:
    """Return the evidence against a term that gains in a share of the bootstrap
    samples.
    """
    if share >= trials.policy.sure:
        return "its strength varies so much between stretches that it might be zero"
    return f"it gains in {share:.0%} of the redrawn sets of stretches only"


def _far(trials: Trials) -> Caveat:
    """Caveat: no fit comes near the data; the distance of the best one."""
    least = min(trials.known.values(), key=lambda trial: trial.fit.cost)
    named = listed(sorted(least.names)) if least.names else "none of them"
    return Caveat(
        Reason.FAR_FROM_DATA,
        f"No subset of the known effects comes near these records: the best fit, with "
        f"{named}, misses by {rms_of(least.fit):.2g} times the noise. What is said of "
        f"shape and place is rough.",
        tuple(sorted(least.names)),
    )


def _tie(best: Trial, other: Trial) -> Caveat:
    names = tuple(sorted(other.names))
    written = ("+".join(names) or "none").replace("_", " ")
    return Caveat(
        Reason.TIE,
        f"These records cannot tell {listed(sorted(best.names))} from {written}: the "
        f"BIC differs by {other.bic - best.bic:.1f} only. Record larger and smaller "
        f"bounces, and speeds further apart.",
        names,
    )
