"""Find reasons not to trust a fit, from the result itself."""

import enum
from typing import NamedTuple

import numpy as np

from .engine import (
    Costs,
    crowded_pieces,
    EVENTS,
    FLIGHT,
    IMPACT,
    Point,
    Problem,
    unexplained_jumps,
    Weights,
)


# Costs above which noise does not explain the residuals: per sample of a piece, per
# component of a joint, and per sample of all data. With noise alone, each of them is 1
# on average, and the last one is within a few per cent of 1 for thousands of samples
_PIECE, _JOINT, _MEAN = 4.0, 9.0, 4.0
# Fraction of the pieces whose cost must be below the limit, so that one bad recording
# among many does not matter
_USUAL = 0.75
# Tolerance for reaching a bound, relative to the parameter's scale
_ON_BOUND = 1e-9


class Doubt(enum.Enum):
    """Reasons why a fit does not count as converged.

    Examples:
        >>> from jaxcam.fitting import Doubt
        >>> len(Doubt) > 1
        True
    """

    NO_OPTIMUM = "the iteration ended before an optimum"
    NOT_FINITE = "a parameter, a state, a cost or an error is not a finite number"
    POOR_FIT = "the cost is far above what the noise explains"
    ON_A_BOUND = "a parameter is at a bound"
    NOT_CONSTRAINED = "the data do not constrain a parameter"
    TOO_MANY_EVENTS = "a piece of a recording contains more events than are located"
    UNEXPLAINED_SWITCH = "the samples show a switch where the model does not switch"


class Reason(NamedTuple):
    """A reason not to trust a fit: a `Doubt`, and a sentence that explains it."""

    doubt: Doubt
    """The kind of doubt."""
    sentence: str
    """The doubt in words."""


def not_finite(problem: Problem, point: Point, cost: float, costs: Costs) -> str:
    """Return a sentence that names a non-finite quantity, or an empty string."""
    pieces = problem.pieces
    flown = np.asarray(costs.flown) + np.asarray(costs.joints)
    exists = np.asarray(pieces.exists)
    states = np.all(np.isfinite(np.asarray(point.states)), axis=-1)
    bad = exists & ~(np.isfinite(flown) & states)
    for p, name in enumerate(problem.names):
        if not np.all(np.isfinite(np.asarray(point.values)[:, p])):
            return (
                f"The parameter {name} is not a finite number; start from other values."
            )
    if np.any(bad):
        r, k = np.argwhere(bad)[0]
        when = float(np.asarray(pieces.flown.start)[r, k])
        return (
            f"The model is not finite in {problem.records[r]} from {when:.4g} s "
            f"onwards; check its vector field, gap and impact there, or bound the "
            f"parameters."
        )
    if not np.isfinite(cost):
        return "The cost is not a finite number; check the model and the parameters."
    return ""


def poor_fit(problem: Problem, costs: Costs, weights: Weights | None) -> str:
    """Return a sentence if the cost is far above the noise, otherwise an empty string.

    The test uses the upper quartile over the pieces, so that one bad recording among
    many does not matter, and the mean, so that no part can be very far off.
    """
    pieces = problem.pieces
    weights = weights or problem.everything()
    counts = np.sum(np.asarray(pieces.flown.known), axis=(-3, -2, -1))
    rests = np.sum(np.asarray(pieces.rested.known), axis=(-3, -2, -1))
    used = (np.asarray(weights.flown) > 0) & np.asarray(pieces.exists)
    resting = (np.asarray(weights.rested) > 0) & (rests > 0)
    joints, kind = np.asarray(costs.joints), np.asarray(pieces.joint)
    flown, rested = np.asarray(costs.flown), np.nan_to_num(np.asarray(costs.rested))
    size = problem.start.states.shape[-1]
    sampled = "pieces into which the recordings are divided, the cost per sample"
    joined = "joints between consecutive pieces, the cost per component"
    within, impact = used & (kind == FLIGHT), used & (kind == IMPACT)
    parts = (
        (
            "in flight",
            sampled,
            flown / np.maximum(counts, 1),
            used & (counts > 0),
            _PIECE,
        ),
        ("in contact", sampled, rested / np.maximum(rests, 1), resting, _PIECE),
        ("between pieces of flight", joined, joints / size, within, _JOINT),
        ("at impacts", joined, joints / (size + 1), impact, _JOINT),
    )
    for place, measure, cost, rows, most in parts:
        if not np.any(rows):
            continue
        level = float(np.quantile(cost[rows], _USUAL))
        if not level <= most:
            return (
                f"The fit is poor {place}: in the worst quarter of the "
                f"{measure} is at least {level:.3g} (noise alone gives 1); the model, "
                "the initial values or the stated noise must be wrong."
            )
    total = np.where(used, flown + joints, 0.0)
    rest = np.sum(np.where(resting, rested, 0.0))
    samples = np.sum(np.where(used, counts, 0)) + np.sum(np.where(resting, rests, 0))
    mean = float((np.sum(total) + rest) / max(samples, 1))
    if not mean <= _MEAN:
        r, k = np.unravel_index(np.argmax(total), total.shape)
        when = float(np.asarray(pieces.flown.start)[r, k])
        return (
            f"The fit is poor: the cost per sample is {mean:.3g} (noise "
            f"alone gives 1); it is largest in {problem.records[r]} near {when:.4g} s, "
            "so check the residuals there."
        )
    return ""


def on_a_bound(problem: Problem, free, point: Point) -> list[str]:
    """Return a sentence for each free parameter that is at a bound."""
    values, found = np.asarray(point.values), []
    for name in free:
        parameter = problem.parameter(name)
        column = values[:, problem.names.index(name)]
        near = _ON_BOUND * parameter.size(float(column[0]))
        for bound, side in ((parameter.lower, "lower"), (parameter.upper, "upper")):
            if np.any(np.abs(column - bound) <= near):
                found.append(
                    f"{name} is at its {side} bound {bound:g}, where its standard "
                    f"error is meaningless; widen the bound or fix the parameter."
                )
    return found


def too_many_events(problem: Problem, point: Point, weights: Weights | None) -> str:
    """Return a sentence if the fit has ignored switching events, otherwise an empty
    string.
    """
    weights = weights or problem.everything()
    crowded = crowded_pieces(problem, point) & (np.asarray(weights.flown) > 0)
    if not np.any(crowded):
        return ""
    r, k = np.argwhere(crowded)[0]
    when = float(np.asarray(problem.pieces.flown.start)[r, k])
    return (
        f"In {np.sum(crowded)} of the pieces into which the recordings are divided, "
        f"the model has more than {EVENTS} switching events, of which a fit locates "
        f"only the first {EVENTS}; the first such piece is that of "
        f"{problem.records[r]} at {when:.4g} s. If the model switches so often only "
        "for the present parameters, start from others; otherwise replace the "
        "switching by a smooth law."
    )


def unexplained_switches(
    problem: Problem, point: Point, weights: Weights | None
) -> str:
    """Return a sentence if no event of the model leads to the mode in which a piece
    begins, otherwise an empty string.
    """
    weights = weights or problem.everything()
    given = problem.layout, problem.pieces, point
    jumps = unexplained_jumps(*given, weights.flown)
    if not np.any(jumps):
        return ""
    r, k = np.argwhere(jumps)[0]
    when = float(np.asarray(problem.pieces.flown.start)[r, k])
    times = "once" if np.sum(jumps) == 1 else f"{np.sum(jumps)} times"
    return (
        f"The samples show {times} that the mode (or the side of a surface with "
        f"hysteresis) changes where the model does not switch, first in "
        f"{problem.records[r]} near {when:.4g} s. Start from thresholds with which the "
        "model switches there, or add the transition that it lacks."
    )
