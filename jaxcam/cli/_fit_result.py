"""Compute the result of `jaxcam fit`, and print and save it."""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import equinox as eqx

from .. import fitting
from ..discrepancy import Policy
from ..recordings import Recording, Rig, segment_case, Segments
from ..tables import counted
from ._fit_report import correlation_table, nominal_value, parameter_table
from ._found_impacts import found_impacts
from ._impact_laws import impact_laws
from ._output import Output
from ._saved_system import as_saved


# Standard errors by which a value must exceed its tolerance
_SURE = 3.0
# Reduced cost above which a restitution law is not printed
_CONTRADICTED = 3.0
# Ratio of rms residual to noise above which the columns may have other units
_HOPELESS = 1000.0
# Number of tolerances by which a value must have moved for the same suspicion
_FAR = 10.0


@dataclasses.dataclass(frozen=True)
class Result:
    """A fit of a rig's parameters, with measures of its quality."""

    problem: fitting.Problem
    segments: Sequence[Segments]
    before: fitting.Fit
    after: fitting.Fit
    seen: fitting.Identifiability
    laws: Mapping[str, fitting.RestitutionFit]
    again: fitting.Bootstrap | None
    doubted: str = ""
    """A doubt about the units of a channel, as a sentence, or empty."""

    @property
    def quality(self) -> list[dict[str, Any]]:
        """Return the residual of each recording and channel, compared with the
        noise.
        """
        return [
            {"record": part.record, "channel": part.channel, "rms": part.rms}
            | {"noise": part.noise, "ratio": part.rms / part.noise}
            for part in fitting.residuals(self.after)
        ]

    @property
    def events(self) -> str:
        """Return how many impacts were found; empty if there is none."""
        return found_impacts(self.segments, self.problem.model.system)

    @property
    def sentence(self) -> str:
        """Describe how the fit ended, and how well it explains the samples."""
        return f"{self.after.message} {self.remainder}"

    @property
    def remainder(self) -> str:
        """Describe how well the fit explains the samples."""
        quality = self.quality
        ratio = sum(q["ratio"] for q in quality) / len(quality)
        sentence = (
            f"The rms residual of {self.problem.samples} samples of "
            f"{counted(len(self.problem.records), 'recording')} is {ratio:.3f} times "
            "the sensor noise."
        )
        if ratio > Policy().as_noise and len(self.problem.records) > 1:
            sentence += (
                " The model is incomplete, or the noise is larger than stated; run "
                "`jaxcam diagnose` with the same files to find missing physics."
            )
            drive = self.problem.model.drive
            if isinstance(drive, fitting.Input) and drive.interpolation == "hold":
                sentence += (
                    f" First check that {drive.channel} really keeps its value between "
                    "two samples; if it is continuous, write `interpolation = "
                    '"linear"` under [input] in the rig file.'
                )
        sentence += self._quieter()
        if ratio > _HOPELESS or self._strange(ratio):
            sentence += (
                " Check the units, the signs and the order of the columns first (deg "
                "or rad, ms or s, mm or m)."
            )
            sentence += self._of_drive()
        return sentence

    def _of_drive(self) -> str:
        """Say what may be wrong with the drive or the input of a hopeless fit."""
        model, parameters = self.problem.model, self.problem.parameters
        drive = model.drive
        if isinstance(drive, fitting.Input):
            return (
                f" Check the sign and the unit of the input {drive.channel} in each "
                "recording too."
            )
        if drive is None:
            return ""
        phase = drive.phase(model.system)
        if any(one.where(model) is phase for one in parameters):
            return ""
        return (
            " The phase of the drive is not fitted: unless the zero of its encoder is "
            "known, give the phase a tolerance in the rig file."
        )

    def _quieter(self) -> str:
        """Name the channels whose stated noise is too large."""
        said, quality = "", [q for q in self.quality if not math.isnan(q["rms"])]
        for channel in dict.fromkeys(part["channel"] for part in quality):
            parts = [part for part in quality if part["channel"] == channel]
            noise = parts[0]["noise"]
            rms = math.sqrt(sum(part["rms"] ** 2 for part in parts) / len(parts))
            if rms < Policy().quieter * noise:
                said += (
                    f" The noise of {channel} is stated as {noise:.3g}, but the "
                    f"residual is only {rms:.3g}: check the unit of the noise, or "
                    "state the smaller value; otherwise the standard errors are too "
                    "large."
                )
        return said

    def _strange(self, ratio: float) -> bool:
        """Return whether a value lies so far from its tolerance, or a poor fit ends so
        close to a bound, that a column may have another unit or sign.
        """
        for one in self.after.estimates:
            moved = abs(one.value - nominal_value(self.problem, one.name))
            if moved > _FAR * self.problem.parameter(one.name).tolerance:
                return True
        at_bound = fitting.Doubt.ON_A_BOUND
        poor = ratio > Policy().as_noise
        return poor and any(one.doubt is at_bound for one in self.after.reasons)

    @property
    def outside(self) -> list[str]:
        """Return a sentence for each value that is certainly outside its tolerance."""
        problem, found = self.problem, []
        for one in self.after.estimates:
            tolerance = problem.parameter(one.name).tolerance
            middle = nominal_value(problem, one.name)
            excess = abs(one.value - middle) - tolerance
            if not math.isfinite(one.stderr) or not excess > _SURE * one.stderr:
                continue
            unit = f" {one.unit}" if one.unit not in ("", "-") else ""
            found.append(
                f"The fitted {one.label} is {one.value:.4g} +- {one.stderr:.1g}{unit}, "
                f"outside its tolerance ({middle - tolerance:.4g} to "
                f"{middle + tolerance:.4g}{unit}): correct the rig file if this value "
                "is possible, or look for an effect that acts like it."
            )
        return found

    def to_json(self, about: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fitted system with its errors, for use with `--system` in other
        commands.
        """
        fit: dict[str, Any] = self.after.to_json()
        fit |= {
            "case": about["case"],
            "sentence": self.sentence,
            "notes": about["notes"],
            "identifiability": self.seen.sentences(),
            "most_correlated": self.after.most_correlated(),
            "units_in_doubt": self.doubted,
            "outside_tolerance": self.outside,
            "residuals": self.quality,
            "restitution": {name: law.sentence() for name, law in self.laws.items()},
            "figures": about["figures"],
        }
        if self.again is not None:
            fit["bootstrap_stderr"] = self.again.stderr
        drive, model = self.segments[0].drive, self.after.model(0)
        for one in self.problem.parameters:
            if one.known is not None:
                # a condition known for each recording has its value in the first
                # recording here; save its usual value instead
                usual = one.where(self.problem.model)
                model = eqx.tree_at(one.where, model, usual)
        system = model.system
        if drive is not None:
            # in the saved model, the drive runs at constant speed, and its angle is
            # zero at time zero
            system = model.uniform(0.0, drive.speed)
        return as_saved(system, fit)


def fitted(
    runs: Iterable[Recording],
    nominal: Rig | fitting.Setup,
    bootstrap: int,
    iterations: int | None,
    report,
) -> Result:
    """Segment the recordings and fit the parameters of the rig.

    **Arguments:** `bootstrap`: number of Bayesian bootstrap replicates; 0 omits them.
    `iterations`: maximum number of iterations of the fit; `None`: that of `fit`.

    Raises:
        ValueError: No parameter of the rig has a tolerance.
    """
    runs, doubted = tuple(runs), ""

    def cutting(share: float) -> None:
        report("finding impacts and contacts", share)

    if isinstance(nominal, fitting.Setup):
        nominal, moved = nominal.without_lags(runs)
        model, parameters = nominal.model, nominal.parameters
        if not parameters:
            raise ValueError(
                "There is nothing to fit; state a `tolerance` for at least one entry "
                "of [parameters] in the rig file."
            )
        segments = nominal.segments(moved, progress=cutting)
        doubted = nominal.contact_in_doubt(segments)
    else:
        model = fitting.cam_follower_model(nominal)
        parameters = fitting.cam_follower_parameters(nominal)
        segments = segment_case(runs, nominal, progress=cutting)
    report("preparing the fit", None)
    problem = fitting.Problem.build(model, segments, parameters)
    before = fitting.fit(problem, free=())
    seen = fitting.identify(problem, at=before)
    limit: dict[str, Any] = {} if iterations is None else {"iterations": iterations}
    after = fitting.fit(
        problem,
        **limit,
        progress=lambda k, cost: report(f"fitting, step {k}", None),
    )
    if isinstance(nominal, fitting.Setup):
        laws = impact_laws(segments, model.system)
    else:
        laws = fitting.restitution_laws(segments)
    # a law means nothing if its fit did not converge, or if the speeds before and after
    # the impacts, which assume the initial values of the parameters, contradict it
    laws = {
        name: law
        for name, law in laws.items()
        if law.converged and law.reduced_cost < _CONTRADICTED
    }
    again = None
    if bootstrap:
        again = fitting.bootstrap(
            after, bootstrap, progress=lambda k, n: report("bootstrap", k / n)
        )
    return Result(problem, segments, before, after, seen, laws, again, doubted)


def print_fit(output: Output, found: Result, notes: Sequence[str]) -> None:
    """Print tables and sentences to the terminal.

    If a fit failed, the reason goes to standard error instead.
    """
    said = [sentence for sentence in (found.events, found.doubted) if sentence]
    for sentence in (*notes, *said, *found.seen.sentences()):
        output.print(sentence)
    output.print(parameter_table(found.problem, found.after, found.again))
    if len(found.after.estimates) > 1:
        output.print(correlation_table(found.after))
    output.print(found.after.most_correlated())
    for sentence in found.outside:
        output.print(sentence)
    if found.laws:
        output.print(
            "Rough estimates of the restitution from single impacts, for comparison "
            "with the fit of the whole motion above:"
        )
    for name, law in found.laws.items():
        where = name.rpartition(", ")[0]
        sentence = law.sentence()
        output.print(f"{where}: {sentence}" if where else sentence)
    output.print(found.sentence if found.after.converged else found.remainder)
