"""The result of a diagnosis: verdict and evidence, as text and as JSON."""

import dataclasses
import enum
from typing import Any, NamedTuple

import equinox as eqx

from ...fitting import Fit, Model, Residuals
from ...hybrid import HybridSystem
from ...tables import ShortTable
from ..evidence import Differing, Ripple, Structure
from ..policy import Policy
from ..terms import (
    FittedFunction,
    system_with_element,
    Value,
    Where,
    WithTerms,
)
from ._caveats import Caveat
from ._missing import MissingFunction
from ._words import number, spelled


class Verdict(enum.StrEnum):
    """The verdict of a diagnosis, as a string such as `"none"`.

    Examples:
        >>> from jaxcam.discrepancy import Verdict
        >>> Verdict("none") == "none"
        True
    """

    EFFECT = "effect"
    NONE = "none"
    UNKNOWN = "unknown"


class Alternative(NamedTuple):
    """Another subset of terms, or other functions, with the difference in BIC.

    `name` joins the names of its `terms`, or is `"none"`, or gives functions by a
    formula or by their arguments; `reason` states why this alternative was not chosen.
    """

    name: str
    """The names of its `terms` joined, `"none"`, or a description of its functions."""
    delta_bic: float
    """BIC minus that of the chosen subset."""
    terms: tuple[str, ...]
    """Names of its terms."""
    reason: str = ""
    """Reason why it is not the verdict."""


@dataclasses.dataclass(frozen=True)
class Effect:
    """One effect that the model lacks."""

    name: str
    """Name of the effect."""
    sentence: str
    """The effect in words."""
    parameters: dict[str, Value]
    """Strengths of the effect."""
    where: str
    """`"flight"`, `"impact"`, `"contact"`, `"drive"` or `"sensor"`."""
    region: str
    """Part of the motion, in words."""
    records: tuple[str, ...]
    """Recordings in which it is significant."""
    delta_bic: float
    """BIC with the effect minus BIC without it."""
    heldout_gain_nats: float
    """Gain in the log-likelihood of held-out data, by all effects together."""
    inclusion: float | None
    """Share of the bootstrap samples in which it would be named; `None` for an unknown
    effect without a function."""
    term: bool = True
    """Whether the effect is a named term; otherwise it is unknown."""
    share: float | None = None
    """Share of the misfit that it explains; for an unknown effect, the unexplained
    share. `None` for the drive, which is diagnosed from its own channel.
    """
    rms_without: float | None = None
    """Predicted rms residual, in units of the noise, if this effect alone is removed
    and everything else is adjusted; `None` if there is no prediction.
    """

    def to_json(self) -> dict[str, Any]:
        """Return the effect as plain numbers and strings."""
        return {
            "name": self.name,
            "parameters": {
                name: dataclasses.asdict(one) for name, one in self.parameters.items()
            },
            "located": {
                "where": self.where,
                "region": self.region,
                "records": list(self.records),
            },
            "evidence": {
                "delta_bic": self.delta_bic,
                "heldout_gain_nats": self.heldout_gain_nats,
                "inclusion": self.inclusion,
                "rms_without": self.rms_without,
            },
            "share": self.share,
        }


@dataclasses.dataclass(frozen=True, repr=False)
class Diagnosis:
    """The result of [`jaxcam.discrepancy.diagnose`][]: what physics the model
    lacks.
    """

    case: str
    """Name of the case."""
    verdict: Verdict
    """A `Verdict`: `"effect"`, `"none"` or `"unknown"`."""
    effects: tuple[Effect, ...]
    """The missing effects."""
    alternatives: tuple[Alternative, ...]
    """Other subsets of terms, the best first."""
    heldout_before: float
    """Rms of the held-out residuals of the textbook model, for predictions one flight
    ahead (in `unit`).
    """
    heldout_after: float
    """Rms of the held-out residuals with the effects (in `unit`)."""
    noise_floor: float
    """Rms of the noise that was used (in `unit`); a caveat is given if it is larger
    than the stated noise.
    """
    unit: str
    """Unit of the residuals."""
    rig: dict[str, Value]
    """Fitted parameters of the model with the effects."""
    summary: str
    """The result in words."""
    before: Fit
    """Fit of the textbook model."""
    after: Fit
    """Fit of the chosen model."""
    left_before: tuple[Structure, ...]
    """Structures searched for in the residuals of the textbook model."""
    left_after: tuple[Structure, ...]
    """Structures searched for in the residuals of the chosen model."""
    unseen: tuple[list[Residuals], list[Residuals]]
    """Held-out residuals of the textbook model and of the chosen model."""
    ripple: Ripple | None
    """Speed ripple of the drive."""
    pulls: dict[str, tuple[float, float]]
    """Deviation of each parameter from nominal, in units of its tolerance: without and
    with the effects.
    """
    limits: dict[str, Value]
    """Detection limits: the smallest strength at which each term would have been named.
    """
    hides: dict[str, str]
    """For each strength, the rig parameter that would absorb most of it."""
    caveats: tuple[Caveat, ...]
    """Caveats, each a reason with its sentence."""
    policy: Policy = Policy()
    """The settings of the diagnosis."""
    missing: tuple[MissingFunction, ...] = ()
    """Unnamed effects (outside the library), as functions fitted together with the rig
    parameters; these functions are part of the model of `after`.
    """
    misfit: dict[str, float] = dataclasses.field(default_factory=dict)
    """Shares of the misfit of the textbook model in `"flight"`, at an `"impact"` and in
    `"contact"`; empty if the misfit is noise.
    """
    differing: Differing | None = None
    """A parameter for which separate values in the recordings explain most of the
    residual of the chosen model; `differing.fit` is the fit with these values.
    """
    location: tuple[str, str] | None = None
    """Names of the coordinate and of the gap on which the effects act; `None` for the
    first ones.
    """

    def __repr__(self) -> str:
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> ShortTable:
        """The summary, and the effects with their evidence."""
        rows = [
            (
                spelled(effect.name),
                ", ".join(
                    f"{name} = {number(one.value, one.stderr, one.unit)}"
                    for name, one in effect.parameters.items()
                ),
                effect.where,
                f"{effect.delta_bic:.0f}",
                f"{effect.heldout_gain_nats:.0f}",
            )
            for effect in self.effects
        ]
        headings = (
            "effect",
            "parameters",
            "where",
            "delta BIC",
            "gain in held-out ln L",
        )
        case = f"{self.case}: " if self.case else ""
        return ShortTable(f"{case}{self.summary}", headings, rows, headings[:3])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    def model(self, record: int | str = 0) -> Model:
        """Return the model with the missing effects, for use in other functions.

        The lags of its sensors are total lags, as in the original recordings.
        """
        model = _whole_lags(self.after.model(record))
        if not isinstance(model.system, WithTerms):
            return model
        exact = tuple(term.exact() for term in model.system.terms)
        return eqx.tree_at(lambda m: m.system.terms, model, exact)

    def system(self, record: int | str = 0) -> HybridSystem:
        """Return the system with the named terms and the functions of unnamed effects.

        The drive turns at the speed of the given recording. Sensor errors are not
        included. A force with an internal state is included with that state: the system
        is then a `WithHidden`, whose additional state components do not change at
        impacts.
        """
        model = self.model(record)
        system = model.system
        if not isinstance(system, WithTerms):
            return system
        used = {name.rsplit("_", 1)[0] for name in self.after.free}
        terms = [
            term
            for term in system.terms
            if Where.SENSOR not in term.acts
            and (
                isinstance(term, FittedFunction)
                and term.label in used
                or term.acts
                and term.name in self.names
            )
        ]
        row = record if isinstance(record, int) else self.records.index(record)
        drive = self.after.problem.segments[row].drive
        if drive is not None:
            system = model.uniform(0.0, drive.speed)
        base, pairs = system.base, system.coordinates  # pyright: ignore
        whole = dataclasses.replace(system, terms=tuple(terms)) if terms else base
        for one in self.missing:
            if one.element is not None:
                whole = system_with_element(whole, one.element, pairs[0])
        return whole

    @property
    def records(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return self.after.problem.records

    def to_json(self) -> dict[str, Any]:
        """Return the verdict as plain numbers and strings."""
        return {
            "case": self.case,
            "verdict": self.verdict,
            "effects": [effect.to_json() for effect in self.effects],
            "alternatives": [
                {
                    "name": one.name,
                    "delta_bic_to_best": one.delta_bic,
                    "reason": one.reason,
                }
                for one in self.alternatives
            ],
            "missing": [one.to_json() for one in self.missing],
            "fit": {
                "heldout_rmse_before": self.heldout_before,
                "heldout_rmse_after": self.heldout_after,
                "noise_floor": self.noise_floor,
                "unit": self.unit,
            },
            "rig": {
                name: {"value": one.value, "stderr": one.stderr}
                for name, one in self.rig.items()
            },
            "differing": None if self.differing is None else self.differing.to_json(),
            "location": self.location
            and dict(zip(("coordinate", "gap"), self.location)),
            "summary": self.summary,
        }


def _whole_lags(model: Model) -> Model:
    """Return a model of recordings whose samples have not been moved."""
    sensors = {
        name: dataclasses.replace(one, removed_lag=0.0)
        for name, one in model.sensors.items()
    }
    return dataclasses.replace(model, sensors=sensors)
