"""The question: recordings, and a system with terms inside it."""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from ...fitting import Parameter, Problem
from ...recordings import Recording, RecordingError, References
from ...recordings.cut import Segments
from ..policy import Policy
from ..terms import SensorTerm, Term


Report = Callable[[str, float | None], None]


class Shown(NamedTuple):
    """The report of a fitted parameter: divided by a constant, with another name."""

    name: str
    divisor: float
    unit: str


@dataclasses.dataclass(frozen=True)
class Question:
    """A problem whose system holds the terms, and what a report needs of the system.

    - `rig`: names of the system's own parameters.
    - `terms`: those that may be named; `unlisted` only describe what is unknown.
    - `turned`: whether there is a drive with a phase.
    - `unit`: of the motion. `references`: constants of the forms of shapes.
    - `drives`: recordings of a drive in the channel `drive_channel`, whose noise is
        `drive_noise`.
    - `shown`: parameters that are reported in another way.
    """

    problem: Problem
    rig: tuple[str, ...]
    terms: tuple[Term, ...]
    unlisted: tuple[Term, ...]
    turned: bool
    unit: str
    references: References
    drives: tuple[Recording, ...] = ()
    drive_noise: float = math.nan
    drive_channel: str = "cam_angle_rad"
    shown: Mapping[str, Shown] = dataclasses.field(default_factory=dict)


def refuse_one(runs: Sequence[Recording | Segments]) -> None:
    if len(runs) < 2:
        raise RecordingError(
            f"There is {len(runs)} recording; give at least two of the same rig at "
            f"different speeds, so that one can be predicted from the other."
        )


def by_listing(terms: tuple[Term, ...]):
    """Terms that may be named, and those that only describe."""
    for term in terms:
        if term.strengths() and not term.acts and not isinstance(term, SensorTerm):
            raise ValueError(
                f"The term {term.name!r} acts nowhere; override its `acceleration`, "
                f"`contact` or `restitution`, or make it a `SensorTerm`."
            )
    return (
        tuple(term for term in terms if term.listed),
        tuple(term for term in terms if not term.listed),
    )


def term_parameters(terms: Sequence[Term], segments, policy: Policy) -> list[Parameter]:
    """Parameters of the terms; a frequency is one only with periods in a record."""
    longest = max(part.recording.duration for part in segments)
    least = policy.fewest_periods / longest
    found = []
    for k, term in enumerate(terms):
        inner = {one.name for one in term.strengths() if one.inner}
        found += [
            dataclasses.replace(p, lower=max(p.lower, least)) if p.name in inner else p
            for p in term.parameters(k)
        ]
    return found
