"""What was found: the verdict, its evidence, and how it is written down."""

import dataclasses
import enum
from typing import Any, NamedTuple

import jax.numpy as jnp

from ...fitting import Fit, Model, Residuals
from ...hybrid import HybridSystem
from ..evidence import Ripple, Structure
from ..policy import Policy
from ..terms import FreeFunction, Value, WithHidden, WithTerms
from ._caveats import Caveat
from ._missing import MissingFunction


class Verdict(enum.StrEnum):
    """What a diagnosis says; equal to its name as a string."""

    EFFECT = "effect"
    NONE = "none"
    UNKNOWN = "unknown"


class Alternative(NamedTuple):
    """Another subset of terms, and how much worse its BIC is.

    `name` puts the names of its `terms` together, or is `"none"`.
    """

    name: str
    delta_bic: float
    terms: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Effect:
    """One thing that the model lacks.

    - `parameters`: its numbers. `where`: `"flight"`, `"impact"`, `"contact"`, `"drive"`
        or `"sensor"`; `region` in words; `records` in which it can be seen.
    - `term`: whether it is one that has a name; otherwise it is the unknown.
    - `delta_bic`: of the model with it, less that of the model without it.
    - `heldout_gain_nats`: log-likelihood gained on data that no parameter has seen.
    - `inclusion`: part of the redrawn data sets in which it would be named; `None`
        where that was not asked, of what is unknown and has no function.
    """

    name: str
    sentence: str
    parameters: dict[str, Value]
    where: str
    region: str
    records: tuple[str, ...]
    delta_bic: float
    heldout_gain_nats: float
    inclusion: float | None
    term: bool = True

    def to_json(self) -> dict[str, Any]:
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
            },
        }


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """The answer to: what physics did the model leave out?

    - `verdict`: a `Verdict`: `"effect"`, `"none"` or `"unknown"`.
    - `effects`: what is missing.
    - `alternatives`: other subsets, each an `Alternative`, the best first.
    - `heldout_before`, `heldout_after`, `noise_floor`: rms of the residuals (`unit`) on
        stretches that no parameter has seen, one flight ahead.
    - `rig`: fitted parameters with what is missing in the model.
    - `before`, `after`: the fits of the textbook model and of the one chosen.
    - `left_before`, `left_after`: shapes that the residuals were asked for.
    - `unseen`: residuals of both on stretches not seen.
    - `ripple`: of the drive. `pulls`: how far each parameter went without the effects,
        held within the tolerances, and with them, in tolerances. `limits`: least
        strength of each term that would have been named. `hides`: the parameter that
        would take up most of each term.
    - `caveats`: each a `Caveat`, a reason with its sentence.
    - `policy`: by which it was decided.
    - `missing`: what has no name, as functions that were fitted with the rig; `after`
        is the model with them.
    """

    case: str
    verdict: Verdict
    effects: tuple[Effect, ...]
    alternatives: tuple[Alternative, ...]
    heldout_before: float
    heldout_after: float
    noise_floor: float
    unit: str
    rig: dict[str, Value]
    summary: str
    before: Fit
    after: Fit
    left_before: tuple[Structure, ...]
    left_after: tuple[Structure, ...]
    unseen: tuple[list[Residuals], list[Residuals]]
    ripple: Ripple | None
    pulls: dict[str, tuple[float, float]]
    limits: dict[str, Value]
    hides: dict[str, str]
    caveats: tuple[Caveat, ...]
    policy: Policy = Policy()
    missing: tuple[MissingFunction, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(effect.name for effect in self.effects)

    def model(self, record: int | str = 0) -> Model:
        """The model with what was missing, for use in every other command."""
        return self.after.model(record)

    def system(self, record: int | str = 0) -> HybridSystem:
        """The system with the terms that were named and no others.

        A drive turns at the speed of that record. Faults of sensors are not part of it.
        A force with a state of its own is a part of it with that state: the system is
        then a `WithHidden`, whose additional components no impact changes.
        """
        model = self.model(record)
        system = model.system
        if not isinstance(system, WithTerms):
            return system
        used = {name.rsplit("_", 1)[0] for name in self.after.free}
        terms = [
            term
            for term in system.terms
            if isinstance(term, FreeFunction)
            and term.label in used
            or term.acts
            and term.name in self.names
        ]
        row = record if isinstance(record, int) else self.records.index(record)
        drive = self.after.problem.segments[row].drive
        if drive is not None:
            angle, rate = (jnp.asarray(x) for x in (0.0, drive.speed))
            system = model.driven(0.0, angle, rate)
        base, pairs = system.base, system.coordinates  # pyright: ignore
        whole = WithTerms(base, tuple(terms), pairs) if terms else base
        for one in self.missing:
            if one.element is not None:
                whole = WithHidden(whole, one.element, pairs[0])
        return whole

    @property
    def records(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return self.after.problem.records

    def to_json(self) -> dict[str, Any]:
        """The verdict as plain numbers and strings."""
        return {
            "case": self.case,
            "verdict": self.verdict,
            "effects": [effect.to_json() for effect in self.effects],
            "alternatives": [
                {"name": one.name, "delta_bic_to_best": one.delta_bic}
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
            "summary": self.summary,
        }
