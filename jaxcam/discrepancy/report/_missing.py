"""Report unnamed physics as a table, in words, and as part of the verdict."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...fitting import Fit
from ..policy import Policy
from ..search import Free, Hidden, Missing
from ..terms import (
    Bivariate,
    BivariateForce,
    Factor,
    Family,
    FittedFunction,
    FreeFunction,
    gaps_of,
    HiddenElement,
    Resonator,
    terms_of,
    unit_along,
    Variable,
    Where,
)
from ._bivariate import bivariate_slopes, bivariate_table
from ._close_forms import CloseForm
from ._curves import (
    covariance_of,
    curve,
    degree_of,
    determined,
    errors_of,
    graded,
    level_of,
    with_slopes,
)
from ._formula import formula_of
from ._hidden import hidden_formula, hidden_table, hidden_unit, hidden_words
from ._product import product_of, product_slopes, product_table
from ._words import quantity


_KINDS = {
    Where.FLIGHT: "force",
    Where.IMPACT: "restitution",
    Where.CONTACT: "surface",
    Where.SENSOR: "sensor",
}
_VERBS = {
    "force": "a force",
    "restitution": "a coefficient of restitution",
    "surface": "a surface error",
    "sensor": "a sensor error",
}
# units of a damping and of a stiffness, both divided by the inertia
_FACTOR_UNITS = {Factor.VELOCITY: "1/s", Factor.DEFLECTION: "1/s^2"}
_ARGUMENT_NAMES = {Variable.APPROACH: "speed"}


@dataclasses.dataclass(frozen=True)
class MissingFunction:
    """An unnamed missing effect: a function that was fitted together with the rig.

    - `kind`: `"force"` is added to the acceleration; `"restitution"` multiplies the
        coefficient of restitution; `"surface"` is added to the surface, and `"sensor"`
        to the reading of the sensor of the first coordinate; `"resonance"` is the force
        of an oscillator that the motion drives.
    - `arguments`: the variables on which it depends, each with its `grid`:
        `"position"`, `"velocity"`, `"phase"`, `"time"` or `"speed"` (of approach); for
        a resonance `"frequency"` (Hz), where the value is the magnitude of the force
        for a unit deflection; for another force with an internal state `"memory"`, the
        time (s) since a unit deflection, or, for a hysteretic force, the distance from
        the last reversal.
    - `value`, `stderr`: value and standard error in `unit` at the points of the grid,
      `(n,)` or `(n, m)`. If rig parameters act like a constant or a straight line, that
      part of the value is not determined, and the error is that of the remainder.
    - `words`: a description. `records`: the recordings that were searched for it.
    - `formula`: the formula of the value, if a parametric form explains as much.
    - `nearly`: otherwise the formula of the best form, if it is close.
    - `knockoffs`: for a force, the number of knockoffs, which take its arguments at
        other moments, and the gain of the best of them as a fraction of its own.
    - `element`: for a force with an internal state, the element for a simulation.
    - `numbers`: for any other function, the names of its fitted parameters.
    - `gap`: for an effect at impacts or of the surface, the name of the gap if there
        are several.
    """

    kind: str
    arguments: tuple[str, ...]
    grid: tuple[Float[np.ndarray, " _"], ...]
    value: Float[np.ndarray, "..."]
    stderr: Float[np.ndarray, "..."]
    unit: str
    words: str
    records: tuple[str, ...]
    formula: str | None = None
    element: HiddenElement | None = None
    numbers: tuple[str, ...] = ()
    gap: str = ""
    nearly: str | None = None
    knockoffs: tuple[int, float] | None = None

    @property
    def slot(self) -> str:
        """Label of the function's parameters in the fit; empty for an element."""
        return self.numbers[0].rpartition("_")[0] if self.numbers else ""

    def to_json(self) -> dict[str, Any]:
        table = {name: at.tolist() for name, at in zip(self.arguments, self.grid)}
        table |= {"value": self.value.tolist(), "stderr": self.stderr.tolist()}
        return {
            "kind": self.kind,
            "arguments": list(self.arguments),
            "table": table,
            "unit": self.unit,
            "formula": self.formula,
            "nearly": self.nearly,
            "knockoffs": self.knockoffs
            and dict(zip(("tried", "best"), self.knockoffs)),
            "gap": self.gap or None,
            "words": self.words,
            "records": list(self.records),
        }


def missing_functions(
    missing: Missing,
    velocities: tuple[float, float],
    positions: tuple[float, float],
    close: Mapping[str, CloseForm],
    policy: Policy,
) -> tuple[MissingFunction, ...]:
    """Return the functions found, each with its errors.

    **Arguments:** the functions found, the ranges of the motion (for the tables of
    functions of two arguments), the closest parametric forms, by the slots of the
    functions, and the policy.
    """
    compared = {one.label: (len(one.shares), one.best) for one in missing.shuffled}
    return tuple(
        _hidden(missing.fit, one, policy.shape_points)
        if isinstance(one, Hidden)
        else dataclasses.replace(
            _one(missing.fit, one, velocities, positions, close.get(one.slot), policy),
            knockoffs=compared.get(one.label),
        )
        for one in missing.functions
    )


def _hidden(found: Fit, hidden: Hidden, points: int) -> MissingFunction:
    along, value, error, element = hidden_table(found, hidden, points)
    unit = hidden.driven.motion_unit
    resonant = isinstance(element, Resonator)
    return MissingFunction(
        "resonance" if resonant else "force",
        ("frequency",) if resonant else ("memory",),
        (along,),
        value,
        error,
        hidden_unit(element, unit),
        hidden_words(found, hidden, element, unit),
        found.problem.records,
        hidden_formula(element),
        element,
    )


def _one(
    found: Fit,
    one: Free,
    velocities,
    positions,
    close: CloseForm | None,
    policy: Policy,
) -> MissingFunction:
    family, kind = one.family, _KINDS[one.family.where]
    numbers = np.array([found[name].value for name in one.coefficients])
    covariance = covariance_of(found, one.coefficients, policy)
    if isinstance(one.prior, Bivariate):
        points, unit = policy.shape_points // 2, _unit(family)
        table = bivariate_table(one.prior, numbers, covariance, points, unit)
        nearly, words = _with_close(table.words, close)
        return MissingFunction(
            kind,
            one.arguments,
            *table[:3],
            unit,
            words,
            found.problem.records,
            numbers=tuple(one.coefficients),
            nearly=nearly,
        )
    if one.gate is not None:
        points = policy.shape_points // 2
        grid, value, error = product_table(one, numbers, covariance, points)
        formula, words = product_of(one, numbers)
        return MissingFunction(
            kind,
            one.arguments,
            grid,
            value,
            error,
            _unit(family),
            words,
            found.problem.records,
            formula,
            numbers=tuple(one.coefficients),
        )
    arguments = tuple(_ARGUMENT_NAMES.get(a, str(a)) for a in family.arguments)  # pyright: ignore
    # a table of two arguments has half as many points along each of them
    points = policy.shape_points // 2 if len(arguments) > 1 else policy.shape_points
    along = np.linspace(family.low, family.high, points)
    if one.primitive is not None:
        along = graded(along, lambda x: curve(one, x, numbers)[0])
    value, basis = curve(one, along, numbers)
    error = errors_of(basis, covariance)
    if one.primitive is None:
        level = errors_of(level_of(family, along, basis), covariance)
        words, formula = _words(family, kind, along, value, level), None
        error = determined(error, level)
    else:
        formula, words = formula_of(family, one.primitive, numbers, kind)
    nearly, words = _with_close(words, close)
    if kind == "restitution":
        value, error = np.exp(value), np.exp(value) * error
    grid: tuple[np.ndarray, ...] = (along,)
    gap = _gap_name(found, family)
    if len(arguments) == 2:
        ends = positions if family.factor is Factor.DEFLECTION else velocities
        factor_at = {
            Factor.VELOCITY: lambda x: x,
            Factor.DIRECTION: lambda x: np.tanh(x / family.slip),
            Factor.DEFLECTION: lambda x: x - family.middle,
        }[family.factor]
        across = graded(np.linspace(ends[0], ends[1], points), factor_at)
        factor, grid = factor_at(across), (along, across)
        value, error = np.outer(value, factor), np.outer(error, np.abs(factor))
    return MissingFunction(
        kind,
        arguments,
        grid,
        value,
        error,
        _unit(family),
        f"{words} (gap: {gap})" if gap else words,
        found.problem.records,
        formula,
        numbers=tuple(one.coefficients),
        gap=gap,
        nearly=nearly,
    )


def _with_close(words: str, close: CloseForm | None) -> tuple[str | None, str]:
    """Return the formula of a close form, and the words with it."""
    if close is None:
        return None, words
    nearly, said = _formula(close.fit, close.form)
    return nearly, f"{words}; to within {close.percent:.2g} %, it is {said}"


def _formula(found: Fit, form: Free) -> tuple[str, str]:
    """Return the formula of a fitted form, and a sentence about it."""
    assert form.primitive is not None
    numbers = np.array([found[name].value for name in form.coefficients])
    kind = _KINDS[form.family.where]
    if form.gate is not None:
        return product_of(form, numbers)
    return formula_of(form.family, form.primitive, numbers, kind)


def _gap_name(found: Fit, family: Family) -> str:
    """Return the name of the gap to which a function belongs, if there are several."""
    problem = found.problem
    if family.where not in (Where.IMPACT, Where.CONTACT) or gaps_of(problem) < 2:
        return ""
    return problem.model.system.constraint_name(family.constraint)


def named_function(found: Fit, one: Free | Hidden) -> str:
    """Return the name of a fitted function: its formula, or its arguments."""
    if isinstance(one, Hidden):
        return one.label
    kind = _KINDS[one.family.where]
    if one.primitive is None:
        return f"{kind} as a function of {' and '.join(one.arguments)}"
    return f"{kind} {_formula(found, one)[0]}"


def slopes_of_function(
    found: Fit, one: MissingFunction, points: int = 100
) -> Float[np.ndarray, "points p"]:
    """Return the derivatives of a function, without its factor, with respect to its
    parameters; those of a function of two arguments, such as a product, on a grid of
    about as many points.
    """
    (term,) = (
        term.exact()
        for term in terms_of(found.model())
        if isinstance(term, FittedFunction) and term.label == one.slot
    )
    if isinstance(term, BivariateForce):
        return bivariate_slopes(term, one.numbers, points)
    assert isinstance(term, FreeFunction)
    if term.gate is not None:
        return product_slopes(term, points)
    along = jnp.linspace(term.low, term.high, points)
    direction = jnp.tanh(along / term.slip) * term.jumping
    numbers = jnp.stack(term.coefficients[: len(one.numbers)])
    return np.asarray(with_slopes(term, along, direction, numbers)[1])


def _unit(family: Family) -> str:
    if family.where is Where.FLIGHT:
        return f"{family.motion_unit}/s^2"
    return "-" if family.where is Where.IMPACT else family.motion_unit


def _words(family: Family, kind: str, along, value, error) -> str:
    """Describe a function, and where it differs most from the part that rig parameters
    can represent: a constant or a straight line.

    **Arguments:** the values along the argument; the errors of this difference.
    """
    of = " and ".join(family.arguments)
    if family.factor is Factor.VELOCITY:
        what = f"damping that depends on the {family.argument}"
    elif family.factor is Factor.DIRECTION:
        what = f"dry friction that depends on the {family.argument}"
    elif family.factor is Factor.DEFLECTION:
        what = f"a stiffness that depends on the {family.argument}"
    else:
        what = f"{_VERBS[kind]} that depends on the {of}"
    # the part that rig parameters can represent cannot be located
    level = level_of(family, along, value)
    sure = np.abs(level) > 2 * error
    k = int(np.argmax(np.where(sure, np.abs(level), -1.0)))
    if not np.any(sure):
        return f"{what}; its location is unclear"
    usual = "a constant" if degree_of(family) == 0 else "a straight line"
    unit = unit_along(family.argument, family.motion_unit)
    place = quantity(f"{along[k]:.3g}", unit)
    by = quantity(
        f"{level[k]:.2g} +- {error[k]:.1g}",
        _FACTOR_UNITS.get(family.factor, _unit(family)),
    )
    return f"{what}; it differs most from {usual} at {family.argument} {place}, by {by}"


def sentence_of(functions: Sequence[MissingFunction]) -> str:
    """Describe all functions in one phrase."""
    return " and ".join(one.words.split(";")[0] for one in functions)
