"""Accept or reject steps, and choose the length of the next step."""

import abc
import enum
from typing import Any, NamedTuple

import equinox as eqx
from jaxtyping import Bool

from ._settings import BranchSettings


class Refusal(enum.StrEnum):
    """Reasons for rejecting a step, as parts of a sentence."""

    NOT_CONVERGED = "the corrector did not converge"
    FARTHER = "the correction was longer than the step"
    TURNED = "the branch turned too sharply"


class StepMeasures(NamedTuple):
    """Measures of a step: NumPy numbers, or traced values in a batch."""

    iterations: Any
    """Number of corrector iterations."""
    correction: Any
    """Length of the correction."""
    angle: Any
    """Angle between the tangents at both ends (rad)."""


class AbstractStepControl(eqx.Module):
    """Accepts or rejects steps and chooses their lengths, for a branch or a batch."""

    @abc.abstractmethod
    def refusals(
        self, measures: StepMeasures, step: Any, settings: BranchSettings
    ) -> dict[Refusal, Bool[Any, ""]]:
        """Return whether each reason to reject a step applies; the first one is
        reported.

        Args:
            measures: Measures of the step.
            step: The step length.
            settings: Accuracy and step control.

        Returns:
            A flag for each `Refusal`.
        """

    @abc.abstractmethod
    def next_step(
        self, measures: StepMeasures, step: Any, settings: BranchSettings
    ) -> Any:
        """Return the length of the step after an accepted one.

        Args:
            measures: Measures of the step.
            step: The step length.
            settings: Accuracy and step control.

        Returns:
            The next length.
        """


class EffortAndAngle(AbstractStepControl):
    """Adapt the step to the number of corrector iterations and the curvature of the
    branch.

    See the thesis, section 3.4.4.
    """

    def refusals(self, measures: StepMeasures, step: Any, settings: BranchSettings):
        return {
            Refusal.FARTHER: measures.correction > step,
            Refusal.TURNED: measures.angle > settings.max_angle,
        }

    def next_step(
        self, measures: StepMeasures, step: Any, settings: BranchSettings
    ) -> Any:
        s = settings
        xp = _namespace(measures.angle)
        effort = 2.0 ** ((s.iterations - measures.iterations) / 2)
        straight = s.angle / xp.maximum(measures.angle, 1e-3 * s.angle)
        factor = xp.clip(xp.minimum(effort, straight), 0.5, 2.0)
        return xp.clip(step * factor, s.min_step, s.max_step)


def measure_step(a: Any, b: Any, guess: Any) -> StepMeasures:
    """Return the measures of the step from a to b, which was corrected from `guess`."""
    xp = _namespace(b.z)
    old, new = a.tangent / b.scale, b.tangent / b.scale
    cosine = (old @ new) / (xp.linalg.norm(old) * xp.linalg.norm(new))
    angle = xp.arccos(xp.clip(cosine, -1.0, 1.0))
    correction = xp.linalg.norm((b.z - guess) / a.scale)
    return StepMeasures(b.iterations * 1.0, correction, angle)


def _namespace(x: Any) -> Any:
    """Return the module for arrays like x: NumPy or jax.numpy."""
    return x.__array_namespace__()
