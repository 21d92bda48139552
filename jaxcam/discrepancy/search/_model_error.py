"""Allow for the errors of a model that is far from the data.

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
from ...fitting.engine import allowing, FLIGHT, IMPACT
from ..policy import Policy
from ._given_up import given_up
from ._question import ModelError, Question, with_noise


# Maximum number of fits; the joints are consistent with the samples if the ratio of
# their costs is within this factor
_ROUNDS, _CONSISTENT = 12, 2.0


def far_from_data(bare: Fit, best: Fit, policy: Policy) -> bool:
    """Return whether a fit is so far from the data that model errors dominate.

    Named terms that explain nearly all of the misfit count, although what they leave
    may be large compared with the noise.

    **Arguments:** the fits without terms and with the best ones; the policy.
    """
    samples = best.problem.samples
    if best.cost < policy.model_error**2 * samples:
        return False
    return not best.cost - samples < policy.small * (bare.cost - samples)


def with_model_error(question: Question, policy: Policy) -> Question:
    """Return the question with larger noise and looser joints.

    The joints are as loose as the errors of the textbook model require: each of their
    components costs as much as a sample. The noise of every channel is at least a
    fraction (`policy.resolved`) of the residual that remains.
    """
    found, part = _loosely_joined(question.problem, question.rig, policy)
    errors = _errors(found, policy)
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
    problem = dataclasses.replace(problem, extras=allowing(problem.extras, part))
    return dataclasses.replace(question, problem=problem, model_errors=errors)


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
    part, point = 1.0, problem.start
    for _ in range(_ROUNDS):
        found = fit(
            dataclasses.replace(problem, extras=allowing(problem.extras, part)),
            free=rig,
            start=point,
            iterations=policy.iterations,
            stop=given_up(problem.samples, policy),
        )
        samples = np.nansum(found.costs.flown) + np.nansum(found.costs.rested)
        ratio = np.sum(found.costs.joints) / max(components, 1)
        ratio = float(ratio / samples * problem.samples)
        if not math.isfinite(ratio) or 1 / _CONSISTENT < ratio < _CONSISTENT:
            break
        part, point = part * math.sqrt(ratio), found.point
    return found, part


def _errors(found: Fit, policy: Policy) -> tuple[ModelError, ...]:
    """Return the residuals of the channels, and the noise to be used for each."""
    squares: dict[str, list[np.ndarray]] = {}
    for one in residuals(found):
        squares.setdefault(one.channel, []).append(one.value**2)
    errors = []
    for name, sensor in found.problem.model.sensors.items():
        if name not in squares:
            continue
        residual = math.sqrt(np.mean(np.concatenate(squares[name])))
        stated = float(sensor.floor)
        used = max(stated, policy.resolved * residual)
        errors.append(ModelError(name, stated, residual, used))
    return tuple(errors)
