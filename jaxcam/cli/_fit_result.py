"""The result of `jaxcam fit`: computed, and as words and data."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import equinox as eqx

from .. import fitting
from ..recordings import Recording, Rig, segment_case, Segments
from ._fit_report import correlation_table, parameter_table
from ._impact_laws import impact_laws
from ._output import Output
from ._saved_system import as_saved


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
        """Return the residual of each record and channel, compared with the noise."""
        return [
            {"record": part.record, "channel": part.channel, "rms": part.rms}
            | {"noise": part.noise, "ratio": part.rms / part.noise}
            for part in fitting.residuals(self.after)
        ]

    @property
    def sentence(self) -> str:
        """Say how well the fit explains its samples."""
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
        drive, model = self.segments[0].drive, self.after.model(0)
        for one in self.problem.parameters:
            if one.known is not None:
                # what was so in the first record only
                usual = one.where(self.problem.model)
                model = eqx.tree_at(one.where, model, usual)
        system = model.system
        if drive is not None:
            # the rig as a whole: the encoder's zero is the geometry's, the speed free
            system = model.driven(0.0, 0.0 * drive.phase, drive.speed)
        return as_saved(system, fit)


def fitted(
    runs: Iterable[Recording], nominal: Rig | fitting.Setup, bootstrap: int, report
) -> Result:
    """Cut the runs, fit, and say what the recordings can distinguish.

    **Arguments:** `bootstrap`: number of random weightings of the flights; 0 is none.

    Raises:
        ValueError: For a rig of which nothing is to be fitted.
    """
    runs = tuple(runs)

    def cutting(share: float) -> None:
        report("finding impacts and contacts", share)

    if isinstance(nominal, fitting.Setup):
        model, parameters = nominal.model, nominal.parameters
        if not parameters:
            raise ValueError(
                "There is nothing to fit; give at least one entry of [parameters] in "
                "the rig file a `tolerance`."
            )
        segments = nominal.segments(runs, progress=cutting)
    else:
        model = fitting.cam_follower_model(nominal)
        parameters = fitting.cam_follower_parameters(nominal)
        segments = segment_case(runs, nominal, progress=cutting)
    report("preparing the fit", None)
    problem = fitting.Problem.build(model, segments, parameters)
    before = fitting.fit(problem, free=())
    seen = fitting.identify(problem, at=before)
    after = fitting.fit(
        problem, progress=lambda k, cost: report(f"fitting, step {k}", None)
    )
    if isinstance(nominal, fitting.Setup):
        laws = impact_laws(segments)
    else:
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
    for name, law in found.laws.items():
        where = name.rpartition(", ")[0]
        sentence = law.sentence()
        output.print(f"{where.capitalize()}: {sentence}" if where else sentence)
    output.print(found.sentence)
