"""Resume a branch from its saved points."""

from collections.abc import Sequence

import numpy as np

from ._closed import Past
from ._context import Context
from ._point import Point, with_field, with_parameter
from ._program import evaluate
from ._solution import changes_of, Solution, solution_at
from .problem import AbstractProblem


def resumed(
    context: Context, problem: AbstractProblem, start: Point, history: Sequence[Point]
) -> tuple[Solution, Past, list[Point]]:
    """Return the solution at the last saved point, the points passed so far, and the
    special points at which the problem changed.
    """
    z = np.append(start.state, start.parameter)
    problem = with_parameter(problem, context.leaf, z[-1])
    problem = problem.refreshed(z[:-1], problem.parameters)
    at = evaluate(problem, context, z, start.tangent)
    # use the stored tangent and scale: the resumed branch must be bit-identical
    at = with_field(at, "tangent", np.asarray(start.tangent))
    at = with_field(at, "scale", np.asarray(start.scale))
    # no step begins at a point between two special points
    before = [p for p in history if p.label < start.label]
    before = [p for p in before if p.special or p.step > 0]
    trail = tuple(
        (np.append(p.state, p.parameter), p.tangent)
        for p in before
        if not p.special and p.signature == start.signature
    )
    # a point between two special points has no step of its own
    step = start.step or context.settings.step
    current = solution_at(problem, context.leaf, at, step, start.arclength, trail)
    past, known = Past(context.leaf), [*before, start]
    for point in known:
        if not point.special:
            same = point.signature == problem.signature
            past.add(
                problem if same else problem.with_signature(point.signature), point
            )
    return current, past, changes_of(known)
