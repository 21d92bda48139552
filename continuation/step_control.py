"""Which steps are taken, and how long the next one is."""

import abc
import enum
from typing import Any, NamedTuple

import equinox as eqx
from jaxtyping import Bool

from ._settings import BranchSettings


class Refusal(enum.StrEnum):
    """Why a step is not taken, as the end of a sentence."""

    NOT_CONVERGED = "the corrector did not converge"
    FARTHER = "the corrector went farther than the step was long"
    TURNED = "the branch turned too sharply"


class Way(NamedTuple):
    """What a step has been like. NumPy's numbers, or traced ones in a batch."""

    iterations: Any
    """Of the corrector."""
    correction: Any
    """Length of its correction."""
    angle: Any
    """Between the tangents at both ends, rad."""


class AbstractStepControl(eqx.Module):
    """Judges steps; the same arithmetic serves a branch and a batch of branches."""

    @abc.abstractmethod
    def refusals(
        self, way: Way, step: Any, settings: BranchSettings
    ) -> dict[Refusal, Bool[Any, ""]]:
        """For each reason to refuse a step whether it holds; the first is reported."""

    @abc.abstractmethod
    def next_step(self, way: Way, step: Any, settings: BranchSettings) -> Any:
        """Length of the step that follows one that is taken."""


class EffortAndAngle(AbstractStepControl):
    """Longer steps where the corrector is quick and the branch straight (the thesis,
    3.4.4)."""

    def refusals(self, way: Way, step: Any, settings: BranchSettings):
        return {
            Refusal.FARTHER: way.correction > step,
            Refusal.TURNED: way.angle > settings.max_angle,
        }

    def next_step(self, way: Way, step: Any, settings: BranchSettings) -> Any:
        s = settings
        xp = _namespace(way.angle)
        effort = 2.0 ** ((s.iterations - way.iterations) / 2)
        straight = s.angle / xp.maximum(way.angle, 1e-3 * s.angle)
        factor = xp.clip(xp.minimum(effort, straight), 0.5, 2.0)
        return xp.clip(step * factor, s.min_step, s.max_step)


def way_between(a: Any, b: Any, guess: Any) -> Way:
    """From point a of a branch to b, which the corrector found from `guess`."""
    xp = _namespace(b.z)
    old, new = a.tangent / b.scale, b.tangent / b.scale
    cosine = (old @ new) / (xp.linalg.norm(old) * xp.linalg.norm(new))
    angle = xp.arccos(xp.clip(cosine, -1.0, 1.0))
    correction = xp.linalg.norm((b.z - guess) / a.scale)
    return Way(b.iterations * 1.0, correction, angle)


def _namespace(x: Any) -> Any:
    """NumPy or jax.numpy."""
    return x.__array_namespace__()
