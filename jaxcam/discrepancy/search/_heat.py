"""Poor fits: the likelihood divided by the cost per sample."""

import dataclasses
import math

import numpy as np

from ...fitting import Fit, Problem


# Predicted decrease of the cost, in units of the cost per sample, below which a fit
# ends: far less than any decision depends on
_TOLERANCE = 0.1


def heat_of(found: Fit) -> float:
    """Return the cost per sample of a fit, or one if that is larger."""
    return max(1.0, found.cost / found.problem.samples)


def tolerance_at(heat: float) -> float:
    """Return the tolerance of a fit whose cost per sample is `heat`, which is infinite
    if an earlier fit has failed.
    """
    return _TOLERANCE * (heat if math.isfinite(heat) else 1.0)


def heated(problem: Problem, heat: float) -> Problem:
    """Return the problem with the weight of its priors multiplied by `heat`."""
    return dataclasses.replace(
        problem,
        parameters=tuple(
            dataclasses.replace(p, tolerance=p.tolerance / math.sqrt(heat))
            if math.isfinite(p.tolerance)
            else p
            for p in problem.parameters
        ),
    )


def unscaled(blocks, names, heat: float):
    """Return information and score, divided by the cost per sample (`heat`), with the
    parameters `names` in their own units.
    """
    information, score = (x / heat for x in blocks.total())
    unit = np.ones(len(blocks.names))
    own = blocks.rows(names)
    unit[own] = 1 / blocks.scale[own]
    return information * np.outer(unit, unit), score * unit
