"""A caveat about a verdict, and its reason."""

import dataclasses
import enum


class Reason(enum.StrEnum):
    """The reason for a caveat, as a string."""

    SMALL_REMAINDER = "small remainder"
    IN_DOUBT = "in doubt"
    MASKED = "masked by a corner"
    IMITATING = "imitates what is missing"
    NAMED_IN_DOUBT = "named in doubt"
    POOR_FIT = "poor fit"
    TIE = "tie"
    DECOY = "a decoy explains much"
    CHANCE = "no more than a knockoff"
    NOT_SHARED = "not shared by the records"
    DIFFERING = "a parameter differs"
    POOR_PREDICTION = "poor prediction"
    NOT_PREDICTIVE = "functions that do not predict"
    ABOVE_NOISE = "above the noise"
    BEYOND_TOLERANCE = "beyond tolerance"
    NOISIER = "noisier than stated"
    QUIETER = "quieter than stated"
    MODEL_ERROR = "errors of the model"
    UNITS = "units in doubt"
    TIME = "time is over"
    SET_ASIDE = "record set aside"


@dataclasses.dataclass(frozen=True)
class Caveat:
    """A caveat about a verdict."""

    reason: Reason
    """A `Reason`."""
    sentence: str
    """The caveat in words; `str` returns it as well."""
    terms: tuple[str, ...] = ()
    """Names of the terms concerned, if any."""

    def __str__(self) -> str:
        return self.sentence
