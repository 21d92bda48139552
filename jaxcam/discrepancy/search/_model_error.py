"""Allow for the errors of a model whose fit is very poor.

If the residual is very large compared with the noise, the likelihood of the noise says
nothing useful: it is dominated by the errors of the model, which accumulate along a
flight. Until the missing physics is found, the model is therefore compared with single
pieces of flight. The errors of the joints between pieces, and the noise, are raised to
the size that the errors of the model require.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from ...fitting import Fit, fit, Problem, residuals
from ...fitting.engine import allowing, FLIGHT, IMPACT, JOINT, Point
from ..policy import Policy
from ._given_up import given_up
from ._own_values import with_own_values
from ._question import ModelError, Question, with_noise


# Maximum number of fits; the joints are consistent with the samples if the ratio of
# their costs is within this factor
_ROUNDS, _CONSISTENT = 12, 2.0


def model_errors_dominate(bare: Fit, best: Fit, policy: Policy) -> bool:
    """Return whether a fit is so poor that model errors dominate the residual.

    They do not if named terms explain nearly all of the misfit, although the remainder
    may be large compared with the noise.

    **Arguments:** the fits without terms and with the best ones; the policy.
    """
    samples = best.problem.samples
    if best.cost < policy.model_error**2 * samples:
        return False
    if best.cost - samples < policy.small * (bare.cost - samples):
        return False
    # the cost of a rounded sample may be large although its residual is not
    found = _residuals(best).values()
    return any(not rms < policy.model_error * stated for stated, rms in found)


def with_model_error(question: Question, policy: Policy) -> Question | None:
    """Return the question with larger noise and looser joints.

    The joints are as loose as the errors of the textbook model require: each of their
    components costs as much as a sample. The noise of every channel is at least a
    fraction (`policy.resolved`) of the residual that remains.

    **Returns:** the question, or `None` if single pieces of flight hardly show the
    errors, so that only complete flights do.
    """
    found, part = _loosely_joined(question.problem, question.rig, policy)
    errors = tuple(
        ModelError(name, stated, rms, max(stated, policy.resolved * rms))
        for name, (stated, rms) in _residuals(found).items()
    )
    if not any(one.residual**2 > policy.near_cost * one.stated**2 for one in errors):
        return None
    model = found.problem.model
    sensors = dict(model.sensors)
    for one in errors:
        if one.used > one.stated:
            sensors[one.channel] = with_noise(sensors[one.channel], one.used)
    problem = Problem.build(
        dataclasses.replace(model, sensors=sensors),
        found.problem.segments,
        [one for one in found.problem.parameters if one.known is None],
    )
    problem = with_own_values(problem, question.rig)
    problem = dataclasses.replace(problem, extras=allowing(problem.extras, part))
    return dataclasses.replace(
        question, problem=problem, model_errors=errors, looseness=part
    )


def _loosely_joined(
    problem: Problem, rig: Sequence[str], policy: Policy
) -> tuple[Fit, float]:
    """Fit the textbook model with joints whose components cost as much as samples.

    **Returns:** the fit, and the error of the joints relative to that of the state of a
    single piece.
    """
    kinds = np.asarray(problem.pieces.joint)
    size = problem.start.states.shape[-1]
    components = size * np.sum(kinds == FLIGHT) + (size + 1) * np.sum(kinds == IMPACT)

    def fitted(part: float, point: Point) -> Fit:
        return fit(
            dataclasses.replace(problem, extras=allowing(problem.extras, part)),
            free=rig,
            start=point,
            iterations=policy.iterations,
            stop=given_up(problem.samples, policy),
        )

    part = 1.0
    found = fitted(part, problem.start)
    for _ in range(_ROUNDS if components else 0):
        samples = np.nansum(found.costs.flown) + np.nansum(found.costs.rested)
        ratio = np.sum(found.costs.joints) / components
        ratio = float(ratio / samples * problem.samples)
        fresh = min(max(part * math.sqrt(ratio), JOINT), 1 / JOINT**2)
        near = 1 / _CONSISTENT < ratio < _CONSISTENT
        if not math.isfinite(ratio) or near or fresh == part:
            break
        part, found = fresh, fitted(fresh, found.point)
    return found, part


def _residuals(found: Fit) -> dict[str, tuple[float, float]]:
    """Return the noise and the rms residual of each channel."""
    squares: dict[str, list[np.ndarray]] = {}
    for one in residuals(found):
        squares.setdefault(one.channel, []).append(one.value**2)
    return {
        name: (
            float(found.problem.model.sensors[name].floor),
            math.sqrt(np.mean(np.concatenate(parts))),
        )
        for name, parts in squares.items()
    }
