"""Analyse the residuals of a fit: find shapes with a significant gain, and where they
occur.
"""

import dataclasses
import enum
import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Float
from scipy.stats import chi2, norm

from ...fitting import Fit, Problem, residuals
from ...hybrid.programs import program
from ...recordings import References
from ..policy import Policy
from ..search import (
    added_gain,
    Blocks,
    blocks_of,
    extended,
    force_blocks,
    newton_step,
    Periodogram,
    predicted_gain,
    Response,
    separate_gain,
)
from ..terms import Shape, shapes, Term, terms_of, unit_along, Where
from ._imitation import Beside, beside_structure
from ._visited_states import visited_states, VisitedStates


# Lower limit of standard errors that may be zero
_TINY = 1e-300


class Form(enum.StrEnum):
    """The form of a structure in the residuals, as a string."""

    TERM = "term"
    FUNCTION = "function"
    VIBRATION = "vibration"
    COLOURED = "coloured"


@dataclasses.dataclass(frozen=True)
class Structure:
    """A possible structure of the residuals that distinguishes them from noise."""

    name: str
    """Name of the structure."""
    sentence: str
    """The structure in words."""
    where: str
    """Part of the model in which it acts, such as flight, impact or sensor."""
    region: str
    """Part of the motion, in words."""
    gain: float
    """Gain in twice the log-likelihood."""
    threshold: float
    """Required gain, from the error rate and the number of parameters."""
    count: int
    """Number of parameters."""
    unit: str = ""
    """Unit of `value`."""
    variable: str = ""
    """Argument of the shape, if there is one."""
    grid: Float[np.ndarray, " k"] = dataclasses.field(
        default_factory=lambda: np.zeros(0)
    )
    """Values of the argument at which the shape is given."""
    value: Float[np.ndarray, " k"] = dataclasses.field(
        default_factory=lambda: np.zeros(0)
    )
    """The shape at the values in `grid`, in `unit`."""
    stderr: Float[np.ndarray, " k"] = dataclasses.field(
        default_factory=lambda: np.zeros(0)
    )
    """Standard errors of `value`."""

    predicted_gain: float = math.inf
    """If `gain` exceeds its threshold, the gain in twice the log-likelihood when the
    effect in either half of the recordings is estimated from the other half, summed
    over both halves. It is negative for an effect that differs from recording to
    recording.
    """
    form: Form = Form.FUNCTION
    """An unlisted term, a free function, a vibration, or residuals that are correlated
    in time."""
    argument_unit: str = ""
    """Unit of `grid`."""
    quantity: str = ""
    """The quantity that `value` describes."""
    differs: bool = False
    """Whether it certainly differs from recording to recording: a separate value for
    each recording explains significantly more."""
    named: Mapping[str, Beside] = dataclasses.field(default_factory=dict)
    """If the fit is poor: the loss of fit that the omission of each named term causes,
    in the present fit and with the structure fitted as well.
    """

    @property
    def significant(self) -> bool:
        """Whether its gain exceeds the threshold, also on held-out data."""
        return self.gain > self.threshold and self.predicted_gain > 0

    @property
    def place(self) -> str:
        """Describe the region, and where in it the shape is clearest."""
        if not len(self.grid):
            return self.region
        size = np.abs(self.value)
        # where a curve crosses zero, its error may vanish too
        score = np.where(size >= size.max() / 2, size, 0.0)
        k = int(np.argmax(score / np.maximum(self.stderr, _TINY)))
        return (
            f"{self.region}; clearest at {self.variable} {self.grid[k]:.3g} "
            f"{self.argument_unit}, where it is {self.value[k]:.2g} +- "
            f"{self.stderr[k]:.1g} {self.unit}"
        )


def structures(
    found: Fit,
    response: Response,
    unlisted: Sequence[Term],
    scan: Periodogram,
    turned: bool,
    references: References,
    unit: str,
    policy: Policy,
    parts: Mapping[str, Sequence[str]],
) -> list[Structure]:
    """Test the residuals of a fit for structures, and return them with the largest
    excess first.

    **Arguments:** the fit, the response to a force about it, terms that only describe
    an unknown effect, the periodogram of the residuals, whether there is a drive, the
    constants of the shapes, the unit of the motion, the policy, and the parameters of
    each named term.
    """
    problem, seen = found.problem, visited_states(found.problem)
    more: tuple[Term, ...] = (
        *unlisted,
        *(
            dataclasses.replace(shape, motion_unit=unit)
            for shape in shapes(
                *seen.ranges(policy), turned=turned, references=references
            )
        ),
    )
    # the gains of forces follow from `response`, without compiling a program for each
    forces = [t for t in more if t.acts == (Where.FLIGHT,) and t.coordinate == 0]
    others = [t for t in more if not any(t is force for force in forces)]
    wide = extended(problem, others, found.point)
    tests = len(more) + 2
    chance, heat = policy.false_alarms / tests, max(1.0, found.cost / problem.samples)
    made = []
    for terms, blocks, place in (
        (forces, force_blocks(problem, response, forces), 0),
        (others, blocks_of(wide, wide.start), len(terms_of(problem.model))),
    ):
        information, score = blocks.total()
        free = blocks.rows(response.free)
        for k, term in enumerate(terms):
            own = blocks.rows([p.name for p in term.parameters(place + k)])
            grown = added_gain(
                information, score, free, own, policy.distinct_information
            )
            threshold = _threshold(len(own), problem.samples, tests, policy)
            shape = _shape(term, blocks, information, score, free, own, seen, policy)
            predicted, differs = math.inf, False
            if grown > threshold:
                predicted = predicted_gain(blocks, free, own, policy)
            if predicted <= 0:
                more_gain, number = separate_gain(blocks, free, own, policy)
                differs = more_gain > heat * chi2.isf(chance, max(number, 1))
            named = {}
            if grown > threshold and predicted > 0 and heat > policy.near_cost:
                named = beside_structure(found, blocks, free, own, parts)
            made.append(
                Structure(
                    term.name,
                    term.sentence,
                    term.where,
                    term.region,
                    grown,
                    threshold,
                    len(own),
                    **shape,
                    predicted_gain=predicted,
                    differs=bool(differs),
                    named=named,
                    form=Form.FUNCTION if isinstance(term, Shape) else Form.TERM,
                )
            )
    made += [_vibration(scan, problem, tests, policy), _coloured(found, tests, policy)]
    # shapes come before coloured residuals, which say nothing about the cause
    return sorted(
        made,
        key=lambda one: (
            one.significant and one.form is not Form.COLOURED,
            one.gain - one.threshold,
        ),
        reverse=True,
    )


def _shape(
    term: Term,
    blocks: Blocks,
    information,
    score,
    free,
    own,
    seen: VisitedStates,
    policy: Policy,
) -> dict[str, Any]:
    """Return the fields of a `Structure` that tabulate a fitted shape."""
    if not isinstance(term, Shape):
        return {}
    both = np.union1d(free, own)
    step, covariance = newton_step(information, score, both)
    pick = np.searchsorted(both, own)
    scale = blocks.scale[own]
    covariance = covariance[np.ix_(pick, pick)]
    if not np.isfinite(covariance).all():
        return {}
    return _function(term, step[pick] * scale, covariance, scale, seen, policy)


def _threshold(
    count: int, samples: int, tests: int, policy: Policy, looks: int = 1
) -> float:
    chance = policy.false_alarms / tests / looks
    least = max(count * math.log(samples), float(chi2.isf(chance, count)))
    # a structure must be as certain as a named term
    return (math.sqrt(least) + policy.beyond) ** 2


def _function(
    term: Shape, coefficients, covariance, scale, seen: VisitedStates, policy: Policy
) -> dict[str, Any]:
    """Return the function where there are data; elsewhere its polynomials are
    meaningless.
    """
    grid = np.linspace(*term.ends, policy.shape_points)
    grid = grid[seen.near(term.variable, grid, policy)]
    if not len(grid):
        return {}
    basis = np.asarray(_basis(term, grid))
    spread = basis * scale
    error = np.sqrt(np.maximum(np.einsum("kp,pq,kq->k", spread, covariance, spread), 0))
    return {
        "unit": term.written(term.unit),
        "variable": term.variable,
        "argument_unit": unit_along(term.variable, term.motion_unit),
        "quantity": term.quantity,
        "grid": grid,
        "value": basis @ coefficients,
        "stderr": error,
    }


@program
def _basis(term: Shape, grid) -> Float[Array, "k p"]:
    return jax.vmap(term.basis)(grid)


def _vibration(
    scan: Periodogram, problem: Problem, tests: int, policy: Policy
) -> Structure:
    frequency, grown = scan.best_separate
    count = 2 * scan.records + 1
    seen = math.inf
    if scan.records > 1:
        # a frequency found in one recording must also appear in the others
        chance = chi2.isf(policy.false_alarms, 2 * (scan.records - 1))
        seen = scan.elsewhere - float(chance)
    return Structure(
        "resonance",
        f"a force at {frequency:.4g} Hz with a separate phase in each recording",
        "flight",
        "in flight",
        grown,
        _threshold(count, problem.samples, tests, policy, scan.cells),
        count,
        predicted_gain=seen,
        differs=seen <= 0,
        form=Form.VIBRATION,
    )


def _coloured(found: Fit, tests: int, policy: Policy) -> Structure:
    """Test whether the residuals are autocorrelated in more than one section."""
    totals, counts, cost = [], [], 0.0
    for part in residuals(found):
        value = part.value / part.noise
        cost += float(np.sum(value**2))
        for stretch in np.array_split(np.arange(len(value)), policy.residual_stretches):
            total, count = 0.0, 0
            for lag in range(1, policy.residual_lags + 1):
                a, b = stretch[lag:], stretch[:-lag]
                same = (part.flight[a] == part.flight[b]) & (
                    part.resting[a] == part.resting[b]
                )
                total += float(np.sum((value[a] * value[b])[same]))
                count += int(np.sum(same))
            totals.append(total)
            counts.append(count)
    worst = int(np.argmax(totals))
    total, count = np.sum(totals) - totals[worst], np.sum(counts) - counts[worst]
    score = float(total) / math.sqrt(max(int(count), 1))
    bic = math.log(found.problem.samples)
    chance = float(norm.isf(policy.false_alarms / tests)) ** 2
    # the excess is expressed as the gain of one parameter; the smooth part of the
    # residuals, which the fitted states absorb, is neglected
    return Structure(
        "coloured_residuals",
        "a smooth deviation that no shape describes",
        "flight",
        "in flight and in contact",
        # the gain cannot exceed the cost of the residuals
        min(max(score, 0.0) ** 2, cost),
        (math.sqrt(max(chance, bic)) + policy.beyond) ** 2,
        1,
        form=Form.COLOURED,
    )
