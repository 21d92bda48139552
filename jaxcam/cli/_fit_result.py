"""What `jaxcam fit` finds: computed, and as words and data."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from .. import fitting
from ..models.saved import system_to_json
from ..recordings import Rig, segment_case, Segments
from ._fit_report import correlation_table, parameter_table
from ._output import Output


@dataclasses.dataclass(frozen=True)
class Result:
    """A fit of a rig's parameters, and what says how good it is."""

    problem: fitting.Problem
    segments: Sequence[Segments]
    before: fitting.Fit
    after: fitting.Fit
    seen: fitting.Identifiability
    laws: Mapping[str, fitting.RestitutionFit]
    again: fitting.Bootstrap | None

    @property
    def quality(self) -> list[dict[str, Any]]:
        """What is left of each record and channel, beside the noise."""
        return [
            {"record": part.record, "channel": part.channel, "rms": part.rms}
            | {"noise": part.noise, "ratio": part.rms / part.noise}
            for part in fitting.residuals(self.after)
        ]

    @property
    def sentence(self) -> str:
        """How well the fit explains its samples."""
        quality = self.quality
        ratio = sum(q["ratio"] for q in quality) / len(quality)
        return (
            f"{self.after.message} {self.problem.samples} samples of "
            f"{len(self.problem.records)} records are left with {ratio:.3f} times the "
            "noise of the sensors."
        )

    def to_json(self, about: Mapping[str, Any]) -> dict[str, Any]:
        """The fitted system, for `--system` of other commands, with its errors."""
        fit: dict[str, Any] = self.after.to_json()
        fit |= {
            "case": about["case"],
            "sentence": self.sentence,
            "notes": about["notes"],
            "identifiability": self.seen.sentences(),
            "most_correlated": self.after.most_correlated(),
            "residuals": self.quality,
            "restitution": {name: law.sentence() for name, law in self.laws.items()},
            "figures": about["figures"],
        }
        if self.again is not None:
            fit["bootstrap_stderr"] = self.again.stderr
        # the rig as a whole: the encoder's zero is the geometry's, the speed is free
        drive = self.segments[0].drive
        assert drive is not None
        system = self.after.model(0).driven(0.0, 0.0 * drive.phase, drive.speed)
        return system_to_json(system, about=fit)


def fitted(runs, nominal: Rig, bootstrap: int, report) -> Result:
    """Cut the runs, fit, and say what the recordings can tell apart.

    **Arguments:** `bootstrap`: how often flights are weighted at random; 0 is never.
    """
    segments = segment_case(tuple(runs), nominal)
    report("preparing the fit", None)
    problem = fitting.Problem.build(
        fitting.cam_follower_model(nominal),
        segments,
        fitting.cam_follower_parameters(nominal),
    )
    before = fitting.fit(problem, free=())
    seen = fitting.identify(problem, at=before)
    after = fitting.fit(
        problem, progress=lambda k, cost: report(f"fitting, step {k}", None)
    )
    laws = fitting.restitution_laws(segments)
    again = None
    if bootstrap:
        again = fitting.bootstrap(
            after, bootstrap, progress=lambda k, n: report("weighting flights", k / n)
        )
    return Result(problem, segments, before, after, seen, laws, again)


def print_fit(output: Output, found: Result, notes: Sequence[str]) -> None:
    """Tables and sentences for the terminal."""
    for sentence in (*notes, *found.seen.sentences()):
        output.print(sentence)
    output.print(parameter_table(found.problem, found.after, found.again))
    output.print(correlation_table(found.after))
    output.print(found.after.most_correlated())
    for law in found.laws.values():
        output.print(law.sentence())
    output.print(found.sentence)
