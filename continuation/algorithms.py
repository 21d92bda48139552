"""Continuation algorithms: predictor, corrector and step control."""

import abc
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Float

from .predictors import AbstractPredictor, Extrapolation, TangentPredictor
from .step_control import AbstractStepControl, EffortAndAngle


class AbstractAlgorithm(eqx.Module):
    """A predictor, the closing equation of the corrector and the step control."""

    predictor: eqx.AbstractVar[AbstractPredictor]
    """Extrapolates the branch."""
    control: eqx.AbstractVar[AbstractStepControl]
    """Step control."""
    least_norm: eqx.AbstractClassVar[bool]
    """Whether corrections have the least norm instead of lying in a fixed hyperplane.
    """

    @abc.abstractmethod
    def normal(self, tangent: Float[Any, " n+1"]) -> Float[Any, " n+1"]:
        """Return the normal of the corrector's hyperplane, given the tangent.

        The components of both are divided by the scales of the problem.

        Args:
            tangent: Tangent of the branch, `(n+1,)`; a NumPy array, or traced in a
                batch.

        Returns:
            The normal, shape `(n+1,)`.
        """


class Natural(AbstractAlgorithm):
    """Natural continuation: corrections leave one component unchanged.

    See the thesis, section 3.4.3, method 1.

    Examples:
        >>> import continuation
        >>> continuation.Natural().component
        'parameter'
    """

    predictor: AbstractPredictor = Extrapolation()
    """Extrapolates the branch; default: linear extrapolation (thesis, eq. 3.40)."""
    control: AbstractStepControl = EffortAndAngle()
    """Step control; by default, based on the number of iterations and the angle."""
    component: str = eqx.field(static=True, default="parameter")
    """The fixed component: `"parameter"`, with which the branch stops at folds; or
    `"fastest"`, the component that changes most at each step, with which it passes
    folds.
    """
    least_norm: ClassVar[bool] = False
    """Corrections leave one component unchanged, instead of having the least norm."""

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
    """Pseudo-arclength predictor-corrector, which passes folds (thesis, section 3.4.3,
    method 2).

    Examples:
        >>> import continuation
        >>> from continuation.predictors import Secant
        >>> continuation.PseudoArclength(predictor=Secant()).predictor.stations
        2
    """

    predictor: AbstractPredictor = TangentPredictor()
    """Extrapolates the branch; default: along the tangent."""
    control: AbstractStepControl = EffortAndAngle()
    """Step control; by default, based on the number of iterations and the angle."""
    least_norm: ClassVar[bool] = False
    """Corrections are orthogonal to the tangent."""

    def normal(self, tangent):
        return tangent


class MoorePenrose(AbstractAlgorithm):
    """Predictor-corrector with least-norm corrections from the Moore-Penrose inverse.

    The corrector's hyperplane turns with the iterate. To first order, this is
    equivalent to recomputing the tangent in each iteration (thesis, section 3.4.3,
    method 3).

    Examples:
        >>> import continuation
        >>> continuation.MoorePenrose().least_norm
        True
    """

    predictor: AbstractPredictor = TangentPredictor()
    """Extrapolates the branch; default: along the tangent."""
    control: AbstractStepControl = EffortAndAngle()
    """Step control; by default, based on the number of iterations and the angle."""
    least_norm: ClassVar[bool] = True
    """Corrections have the least norm."""

    def normal(self, tangent):
        return tangent
