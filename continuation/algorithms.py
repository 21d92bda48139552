"""Algorithms: how a branch is predicted, corrected and stepped along."""

import abc
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Float

from .predictors import AbstractPredictor, Extrapolation, TangentPredictor
from .step_control import AbstractStepControl, EffortAndAngle


class AbstractAlgorithm(eqx.Module):
    """A predictor, the equation that closes the corrector's system, and what controls
    the steps."""

    predictor: eqx.AbstractVar[AbstractPredictor]
    control: eqx.AbstractVar[AbstractStepControl]
    least_norm: eqx.AbstractClassVar[bool]
    """Whether the corrector takes the shortest corrections instead of a fixed plane."""

    @abc.abstractmethod
    def normal(self, tangent: Float[Any, " n+1"]) -> Float[Any, " n+1"]:
        """Normal of the corrector's plane, given the tangent; both scaled. NumPy
        arrays, or traced ones in a batch."""


class Natural(AbstractAlgorithm):
    """Corrections leave one component alone (the thesis, 3.4.3, 1)."""

    predictor: AbstractPredictor = Extrapolation()
    """By default the linear extrapolation (3.40)."""
    control: AbstractStepControl = EffortAndAngle()
    """Of the steps, by effort and angle."""
    component: str = eqx.field(static=True, default="parameter")
    """`"parameter"`, which stops at folds; or `"fastest"`: the component that changes
    most, chosen at each step, which passes them."""
    least_norm: ClassVar[bool] = False

    def __check_init__(self):
        if self.component not in ("parameter", "fastest"):
            raise ValueError(
                f"component is {self.component!r}; give 'parameter' or 'fastest'"
            )

    def normal(self, tangent):
        xp = tangent.__array_namespace__()
        last = tangent.size - 1
        k = last if self.component == "parameter" else xp.argmax(xp.abs(tangent))
        return xp.where(xp.arange(tangent.size) == k, 1.0, 0.0)


class PseudoArclength(AbstractAlgorithm):
    """Corrections are orthogonal to the tangent (3.4.3, 2); passes folds."""

    predictor: AbstractPredictor = TangentPredictor()
    control: AbstractStepControl = EffortAndAngle()
    least_norm: ClassVar[bool] = False

    def normal(self, tangent):
        return tangent


class MoorePenrose(AbstractAlgorithm):
    """Corrections are the shortest ones, by the Moore-Penrose inverse (3.4.3, 3).

    The plane turns with the iterate, which is what recomputing the tangent in each
    iteration does to first order.
    """

    predictor: AbstractPredictor = TangentPredictor()
    control: AbstractStepControl = EffortAndAngle()
    least_norm: ClassVar[bool] = True

    def normal(self, tangent):
        return tangent
