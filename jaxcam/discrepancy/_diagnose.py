"""Diagnose recordings: the verdict is "effect", "none" or "unknown"."""

import dataclasses
import shutil
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from ..fitting import Input, Parameter, Sensor, Setup, Turning
from ..hybrid import HybridSystem
from ..recordings import Recording, Rig, Segments
from ._answer import Answer, answered, Conditions
from ._elsewhere import falls_short, law_elsewhere, sought_elsewhere
from ._lagging import long_lag, more_accurate
from ._mappings import make_room
from ._set_aside import not_set_aside, odd_record, set_aside, visits_own_states
from .policy import Policy
from .report import Diagnosis, Verdict
from .search import (
    Candidates,
    Clock,
    Question,
    Report,
    rig_question,
    segmented,
    setup_question,
    system_question,
)
from .terms import Location


def diagnose(
    system: HybridSystem | Rig | Setup,
    recordings: Sequence[Recording | Segments],
    candidates: Candidates = None,
    *,
    sensors: Mapping[str, Sensor] | None = None,
    parameters: Sequence[Parameter] = (),
    drive: Turning | Input | None = None,
    case: str = "",
    seed: int = 0,
    progress: Callable[[str, float | None], None] | None = None,
    keep: Path | None = None,
    policy: Policy = Policy(),
) -> Diagnosis:
    """Determine from recordings what physics a model lacks.

    A diagnosis takes minutes; [Model discrepancy](../discrepancy.md) shows examples.
    Terms of the library and unknown forces are sought at the first coordinate and the
    first gap, and unknown functions that act at impacts are sought at the first two
    gaps. Other coordinates and gaps are tried only if a residual above the noise
    remains; each such additional search takes as long again.

    Args:
        system: A `Rig` from `jaxcam.recordings.read_rig` or a `Setup` from
            `jaxcam.fitting.read_setup`, each with sensors and tolerances; or a
            bare system: any system with at least one coordinate, together with
            `sensors`, `parameters` and `drive`.
        recordings: At least two recordings of a rig; for a bare system, segments from
            `jaxcam.recordings.segment`.
        candidates: Terms that may be named; default: `library()`, with the constants of
            the rig; `"extended"`: the same with `library(extended=True)`. Terms with
            `listed=False` only help to describe an unknown effect.
        sensors: For a bare system, as for `jaxcam.fitting.Model`.
        parameters: For a bare system, as for `jaxcam.fitting.Problem`.
        drive: For a bare system, its measured drive or input.
        case: Name of the case.
        seed: Seed of the block bootstrap.
        progress: Called with a sentence and the completed fraction (or `None`).
        keep: Folder in which fits are stored until the diagnosis is complete; an
            interrupted diagnosis continues from there.
        policy: Settings that determine the verdict and limit the search time.

    Returns:
        A [`jaxcam.discrepancy.Diagnosis`][].

    Raises:
        RecordingError: The recordings are insufficient; the message gives the reason.
        ValueError: A term overrides none of the methods through which it can act; or
            `candidates` is an unknown word.
    """
    if isinstance(candidates, str) and candidates != "extended":
        raise ValueError(f'`candidates` is "{candidates}"; give terms, or "extended".')
    conditions = Conditions(
        case,
        seed,
        progress or (lambda sentence, fraction: None),
        policy,
        Clock(policy.minutes),
    )
    rig = _Rig(system, candidates, sensors, parameters, drive)
    make_room()

    def asked(
        runs: Sequence[Recording | Segments],
        folder: Path | None,
        location: Location = Location(),
        lags: Mapping[str, float] = MappingProxyType({}),
        before: Answer | None = None,
    ) -> Answer:
        question = rig.question(runs, location, lags, conditions)
        return answered(question, folder, conditions, before)

    def asked_at(location: Location) -> Diagnosis:
        conditions.report(f"searching at {location.numbered}", None)
        folder = keep and keep / "at_{}_{}".format(*location)
        return asked(recordings, folder, location, lags).diagnosis

    first = asked(recordings, keep)
    lags = long_lag(first.diagnosis, recordings)
    if lags:
        conditions.report("repeating the diagnosis without the lag", None)
        folder = None if keep is None else keep / "without_lag"
        again = asked(recordings, folder, lags=lags, before=first.named)
        better = more_accurate(again.diagnosis, first.diagnosis)
        first, lags = (again, lags) if better else (first, {})
    found, library = first.diagnosis, candidates in (None, "extended")
    odd = odd_record(found.after, policy)
    if odd is not None:
        conditions.report(f"repeating the diagnosis without {odd}", None)
        others = [run for run in recordings if _name_of(run) != odd]
        folder = None if keep is None else keep / "without_one"
        again = asked(others, folder, lags=lags, before=first)
        found = _without_or_with(odd, first, again.diagnosis)
    elif falls_short(found) or library and law_elsewhere(found):
        found = sought_elsewhere(found, asked_at, library)
    if keep is not None and not conditions.clock.stopped:
        # with more time, an interrupted search may continue from its fits
        shutil.rmtree(keep, ignore_errors=True)
    return found


def _without_or_with(odd: str, first: Answer, again: Diagnosis) -> Diagnosis:
    """Return the diagnosis without or with an inconsistent recording.

    If nothing is missing in the others, physics may be missing that acts only in states
    which the inconsistent recording alone visits; it is then sought.

    **Arguments:** the name of the recording, the answer for all recordings, and the
    diagnosis of the others.
    """
    found = first.diagnosis
    problem, policy = found.after.problem, found.policy
    if again.verdict is Verdict.NONE and visits_own_states(problem, odd, policy):
        return not_set_aside(first.with_functions().diagnosis, odd)
    return set_aside(found, again, odd)


def _name_of(run: Recording | Segments) -> str:
    return run.recording.name if isinstance(run, Segments) else run.name


@dataclasses.dataclass(frozen=True)
class _Rig:
    """A rig, a setup or a bare system, with the terms that may be named."""

    system: HybridSystem | Rig | Setup
    candidates: Candidates
    # of a bare system
    sensors: Mapping[str, Sensor] | None
    parameters: Sequence[Parameter]
    drive: Turning | Input | None
    # segments that were found, which do not depend on the location, by recordings (all
    # of which exist as long as the diagnosis) and lags
    _cut: dict[Hashable, tuple[Setup, tuple[Segments, ...]]] = dataclasses.field(
        default_factory=dict
    )

    def _segmented(
        self,
        setup: Setup,
        recordings: Sequence[Recording | Segments],
        lags: Mapping[str, float],
        report: Report,
    ) -> tuple[Setup, tuple[Segments, ...]]:
        key = tuple(map(id, recordings)), tuple(lags.items())
        if key not in self._cut:
            self._cut[key] = segmented(setup, recordings, report, lags)
        return self._cut[key]

    def question(
        self,
        recordings: Sequence[Recording | Segments],
        location: Location,
        lags: Mapping[str, float],
        conditions: Conditions,
    ) -> Question:
        """Return the question to be answered from recordings; `lags` (s) of channels
        replace those of their sensors.
        """
        system, asked = self.system, (conditions.report, conditions.policy)
        offered = recordings, self.candidates
        if isinstance(system, Rig):
            return rig_question(system, *offered, *asked, lags)
        if isinstance(system, Setup):
            parts = self._segmented(system, recordings, lags, conditions.report)
            return setup_question(*parts, self.candidates, *asked, location)
        return system_question(
            system,
            tuple(recordings),  # pyright: ignore
            self.candidates,
            self.sensors,
            self.parameters,
            self.drive,
            *asked,
            location=location,
        )
