"""Algorithms: in which plane the next point is sought."""

import abc
from typing import ClassVar

import equinox as eqx
import numpy as np

from ._predictors import AbstractPredictor, Extrapolation, Tangent


class AbstractAlgorithm(eqx.Module):
    """A predictor and the equation that closes the corrector's system."""

    predictor: eqx.AbstractVar[AbstractPredictor]
    #: whether the corrector takes the shortest corrections instead of a fixed plane
    least_norm: eqx.AbstractClassVar[bool]

    @abc.abstractmethod
    def normal(self, tangent: np.ndarray) -> np.ndarray:
        """(n+1,) normal of the corrector's plane, given the tangent; both scaled."""


class Natural(AbstractAlgorithm):
    """Corrections leave one component alone (the thesis, 3.4.3, 1).

    **Arguments:**

    - `predictor`: by default the linear extrapolation (3.40).
    - `component`: `"parameter"`, which stops at folds; or `"fastest"`: the component
      that changes most, chosen at each step, which passes them.
    """

    predictor: AbstractPredictor = Extrapolation()
    component: str = eqx.field(static=True, default="parameter")
    least_norm: ClassVar[bool] = False

    def __check_init__(self):
        if self.component not in ("parameter", "fastest"):
            raise ValueError(
                f"component is {self.component!r}; give 'parameter' or 'fastest'"
            )

    def normal(self, tangent: np.ndarray) -> np.ndarray:
        normal = np.zeros_like(tangent)
        k = -1 if self.component == "parameter" else int(np.argmax(np.abs(tangent)))
        normal[k] = 1.0
        return normal


class PseudoArclength(AbstractAlgorithm):
    """Corrections are orthogonal to the tangent (3.4.3, 2); passes folds."""

    predictor: AbstractPredictor = Tangent()
    least_norm: ClassVar[bool] = False

    def normal(self, tangent: np.ndarray) -> np.ndarray:
        return tangent


class MoorePenrose(AbstractAlgorithm):
    """Corrections are the shortest ones, by the Moore-Penrose inverse (3.4.3, 3).

    The plane turns with the iterate, which is what recomputing the tangent in each
    iteration does to first order.
    """

    predictor: AbstractPredictor = Tangent()
    least_norm: ClassVar[bool] = True

    def normal(self, tangent: np.ndarray) -> np.ndarray:
        return tangent
