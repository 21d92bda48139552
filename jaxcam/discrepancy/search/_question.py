"""The problem of a diagnosis: recordings, and a system with terms."""

import dataclasses
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Literal, NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np

from ...fitting import Parameter, Problem, Sensor
from ...recordings import Recording, RecordingError, References
from ...recordings.cut import least_noise, Segments
from ..policy import Policy
from ..terms import Location, SensorTerm, Term, Value, Where


Candidates: TypeAlias = Sequence[Term] | Literal["extended"] | None
"""Terms that may be named: those given, the extended library, or the library."""


Report = Callable[[str, float | None], None]


class Shown(NamedTuple):
    """How a fitted parameter is reported: divided by a constant, under another name."""

    name: str
    divisor: float
    unit: str


class FittedSpeed(NamedTuple):
    """The fitted reference speed of a term, and the standard errors of all fitted
    values that result from the error of the speed, by label.
    """

    term: str
    speed: Value
    errors: Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class Question:
    """A problem whose system contains the terms, with the data that a report needs.

    - `rig`: names of the parameters of the system.
    - `terms`: candidate terms; `unlisted` terms only describe an unknown effect.
    - `turned`: whether the system has a drive with a phase.
    - `unit`: unit of the motion. `references`: constants of the shapes.
    - `drives`: recordings of a drive in the channel `drive_channel`, with the noise
        `drive_noise`.
    - `shown`: parameters that are reported in another form.
    - `noisier`: channels with more noise than stated.
    - `doubted`: a doubt about the units of a channel, as a sentence, or empty.
    - `model_errors`: residuals of the channels, if the fit is so poor that errors of
        the model are allowed for.
    - `looseness`: in that case, error of a joint relative to that of the state of a
        single piece.
    - `location`: coordinate and gap on which missing physics acts.
    - `unstated`: names of the references that the rig does not state; `relisted`: a
        function that returns the question with other references; `fitted_speed`: the
        speed among them that was fitted.
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
    noisier: tuple["Noisier", ...] = ()
    doubted: str = ""
    model_errors: tuple["ModelError", ...] = ()
    looseness: float = 1.0
    location: Location = Location()
    unstated: tuple[str, ...] = ()
    relisted: Callable[["Question", References], "Question"] | None = None
    fitted_speed: FittedSpeed | None = None


class Noisier(NamedTuple):
    """A channel whose measured noise `seen` exceeds the `stated` noise."""

    channel: str
    stated: float
    seen: float


class ModelError(NamedTuple):
    """A channel with its `stated` noise, the rms `residual` of the textbook model on
    single pieces of flight, and the noise that was `used`.
    """

    channel: str
    stated: float
    residual: float
    used: float


def with_noise(sensor: Sensor, level: float) -> Sensor:
    """Return a sensor whose noise and rounding have a given standard deviation."""
    white = math.sqrt(level**2 - sensor.resolution**2 / 12)
    return dataclasses.replace(sensor, noise=jnp.asarray(white))


def with_seen_noise(
    sensors: Mapping[str, Sensor], recordings: Sequence[Recording], policy: Policy
) -> tuple[dict[str, Sensor], tuple[Noisier, ...]]:
    """Return the sensors with the measured noise, if it exceeds the stated noise.

    If the stated noise were too small, sensor noise would look like missing physics.
    """
    found, noisier = dict(sensors), []
    for name, sensor in sensors.items():
        stated = float(sensor.floor)
        levels = [least_noise(run[name]) for run in recordings]
        seen = float(np.median(levels))
        if sensor.filtered or not seen > policy.noisier * stated:
            continue
        found[name] = with_noise(sensor, seen)
        noisier.append(Noisier(name, stated, seen))
    return found, tuple(noisier)


def check_runs(runs: Sequence[Recording | Segments]) -> None:
    """Refuse a single recording, and recordings of the same name."""
    if len(runs) < 2:
        raise RecordingError(
            f"There is only {len(runs)} recording; give at least two of the same rig, "
            "so that one can be predicted from the other. A long recording may be "
            "divided into several files."
        )
    names = [r.recording.name if isinstance(r, Segments) else r.name for r in runs]
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        raise RecordingError(
            f"More than one recording is called {repeated[0]!r}; give each a name of "
            "its own, for example by `dataclasses.replace(run, name=...)`."
        )


def by_listing(terms: tuple[Term, ...]):
    """Return the terms that may be named, and those that only describe effects."""
    for term in terms:
        if term.strengths() and not term.acts and not isinstance(term, SensorTerm):
            raise ValueError(
                f"The term {term.name!r} acts nowhere; override its `acceleration`, "
                f"`contact` or `restitution`, or make it a `SensorTerm`."
            )
        if term.starts() and (term.coordinate or term.acts != (Where.FLIGHT,)):
            raise ValueError(
                f"The term {term.name!r} defines `starts`, which require a force on "
                "the first coordinate in flight; let it act only there, or leave "
                "`starts` out."
            )
    return (
        tuple(term for term in terms if term.listed),
        tuple(term for term in terms if not term.listed),
    )


def term_parameters(terms: Sequence[Term], segments, policy: Policy) -> list[Parameter]:
    """Return the parameters of the terms; the lower bound of a frequency is such that
    the longest recording contains enough periods.
    """
    longest = max(part.recording.duration for part in segments)
    least = policy.fewest_periods / longest
    found = []
    for k, term in enumerate(terms):
        inner = {one.name for one in term.strengths() if one.inner}
        if term.starts():
            inner = set()
        found += [
            dataclasses.replace(p, lower=max(p.lower, least)) if p.name in inner else p
            for p in term.parameters(k)
        ]
    return found
