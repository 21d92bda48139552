"""Minimise a cost from a point to an optimum near it, by damped scoring steps."""

import dataclasses
from typing import NamedTuple

import numpy as np

from ._damping import Damping, LEAST_DAMPING
from .engine import (
    Blocks,
    Columns,
    Costs,
    damped_step,
    Extras,
    linearised,
    Point,
    prior_cost,
    Problem,
    total_cost,
)


TOLERANCE = 1e-3
"""Predicted decrease of the cost below which an iteration ends."""
# Largest decrease predicted for an undamped step at an optimum, as a multiple of the
# tolerance: with the default tolerance, such a step changes no parameter by more than a
# tenth of its standard error
_UNDAMPED = 10.0
# Maximum number of corrections before a step is accepted or rejected
_CORRECTIONS = 3
# Each correction must reduce the excess cost to less than this fraction of its previous
# value
_LEADS_BACK = 0.5


class Linear(NamedTuple):
    """A point, its normal equations, the cost of each piece, and the total cost."""

    point: Point
    blocks: Blocks
    costs: Costs
    cost: float


class Descent(NamedTuple):
    """The end point of an iteration and the reason it ended."""

    point: Point
    blocks: Blocks
    costs: Costs
    cost: float
    optimal: bool
    count: int
    ended: str


@dataclasses.dataclass(frozen=True)
class Objective:
    """The cost of the free values of a problem; `prior` tells whether the tolerances
    count.
    """

    problem: Problem
    columns: Columns
    extras: Extras
    prior: bool

    def at(self, point: Point) -> Linear:
        """Return the cost at a point and its normal equations."""
        blocks, costs = linearised(self.problem, self.columns, self.extras, point)
        known = prior_cost(self.problem, self.columns, point, self.prior)
        return Linear(point, blocks, costs, total_cost(costs, self.extras) + known)

    def step(
        self, at: Linear, damping: float, states: float = 0.0
    ) -> tuple[Point, float]:
        """Return the end of a step with damped parameters and states, and the predicted
        decrease of the cost.
        """
        given = self.problem, self.columns, at.blocks, at.point, damping
        return damped_step(*given, self.prior, states)

    def corrected(self, start: Linear, end: Point, damping: Damping) -> Linear:
        """Return the end of a step from `start`, after corrections.

        In a curved, steep valley, a long step ends on the slope: it is assessed after
        corrections, as long as these lead back into the valley quickly.
        """
        found, excess = self.at(end), np.inf
        for _ in range(_CORRECTIONS):
            above = found.cost - start.cost
            if found.cost <= start.cost or not above < _LEADS_BACK * excess:
                break
            excess = above
            end, _ = self.step(found, damping.value, damping.states)
            found = self.at(end)
        return found


def descend(
    objective: Objective,
    point: Point,
    iterations: int,
    stop=None,
    progress=None,
    tolerance: float = TOLERANCE,
) -> Descent:
    """Iterate damped scoring from a point to an optimum near it.

    **Arguments:** `iterations`, `stop`, `progress` and `tolerance` are those of `fit`.
    """
    best, damping = objective.at(point), Damping()
    so_far, optimal, count = [best.cost], False, 0
    for count in range(1, iterations + 1):
        end, promise = objective.step(best, damping.value, damping.states)
        known = bool(np.isfinite(promise))
        if known and promise < tolerance:
            # in a valley, a damped step always predicts little gain; the undamped step
            # must predict little gain as well
            _, whole = objective.step(best, LEAST_DAMPING)
            least = damping.value <= LEAST_DAMPING and not damping.states
            if not whole > _UNDAMPED * tolerance or least:
                optimal, message = True, "The optimum was reached."
                break
            damping = damping.in_a_valley()
        found = objective.corrected(best, end, damping) if known else None
        if found is not None and np.isfinite(found.cost) and found.cost <= best.cost:
            gained = (best.cost - found.cost) / max(promise, 1e-300)
            best, damping = found, damping.accepted(gained)
            if progress is not None:
                progress(count, best.cost)
        else:
            damping = damping.rejected()
            if damping.exhausted:
                message = (
                    "No further step improves the fit, although it is not at an "
                    "optimum; check the residuals, or start from other values."
                )
                break
        so_far.append(best.cost)
        if stop is not None and stop(so_far):
            message = f"The fit was stopped after {count} iterations."
            break
    else:
        message = (
            f"The optimum was not reached in {iterations} iterations; allow more "
            "iterations, or start closer to it."
        )
    return Descent(*best, optimal, count, message)
