"""Predictors of the next point of a branch."""

import abc
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import numpy as np
from jaxtyping import Float

from jaxcam.parameters import AnyArray


class Station(NamedTuple):
    """A point that the branch has passed, in scaled coordinates."""

    y: Float[AnyArray, " n+1"]
    """Scaled state and parameter, `(n+1,)`."""
    tangent: Float[AnyArray, " n+1"]
    """Scaled unit tangent, `(n+1,)`."""


class AbstractPredictor(eqx.Module):
    """Extrapolates a branch from its last points (stations), of which the last is the
    current one.
    """

    stations: eqx.AbstractClassVar[int]
    """Maximum number of points used."""

    @abc.abstractmethod
    def __call__(self, stations: Sequence[Station], step: Any) -> Any:
        """Return the predicted scaled state and parameter `(n+1,)`, about `step` ahead.
        Arrays are NumPy arrays or, in a batch, traced arrays for predictors that use
        one station.
        """


class TangentPredictor(AbstractPredictor):
    """Extrapolate along the tangent (thesis, eqs. 3.30 and 3.33)."""

    stations: ClassVar[int] = 1
    """Number of points used."""

    def __call__(self, stations: Sequence[Station], step: Any) -> Any:
        return stations[-1].y + step * stations[-1].tangent


class Secant(AbstractPredictor):
    """Extrapolate along the line through the last two points."""

    stations: ClassVar[int] = 2
    """Number of points used."""

    def __call__(self, stations: Sequence[Station], step: Any) -> Any:
        current = stations[-1]
        if len(stations) < 2:
            return current.y + step * current.tangent
        chord = current.y - stations[-2].y
        return current.y + step * chord / np.linalg.norm(chord)


class Extrapolation(AbstractPredictor):
    """Take a step in the parameter, and extrapolate the state linearly (thesis, eq.
    3.40).
    """

    stations: ClassVar[int] = 2
    """Number of points used."""

    def __call__(self, stations: Sequence[Station], step: Any) -> Any:
        current = stations[-1]
        chord = current.tangent if len(stations) < 2 else current.y - stations[-2].y
        # near a fold, the state is not a function of the parameter
        if abs(chord[-1]) < 0.1 * np.linalg.norm(chord):
            chord = current.tangent
            return current.y + step * chord
        along = np.sign(current.tangent[-1]) or 1.0
        change = along * step * abs(chord[-1]) / np.linalg.norm(chord)
        return current.y + change / chord[-1] * chord


class PolynomialPredictor(AbstractPredictor):
    """Extrapolate by a polynomial in arclength that matches the last points and the
    last tangent.

    Examples:
        >>> import continuation
        >>> continuation.PolynomialPredictor(order=4).order
        4
    """

    order: int = eqx.field(static=True, default=3)
    """Degree, at least 2; it is lower while there are too few points."""
    stations: ClassVar[int] = 8
    """Number of points used."""

    def __check_init__(self):
        if not 2 <= self.order <= self.stations:
            raise ValueError(
                f"order is {self.order}; give a degree from 2 to {self.stations}"
            )

    def __call__(self, stations: Sequence[Station], step: Any) -> Any:
        used = stations[-self.order :]
        current = used[-1]
        y = np.stack([station.y for station in used])
        lengths = np.linalg.norm(np.diff(y, axis=0), axis=1)
        s = -np.concatenate([np.cumsum(lengths[::-1])[::-1], [0.0]])
        # y(s) = y0 + s t0 + s^2 q(s), where q interpolates the earlier points
        past = s[:-1]
        if past.size == 0:
            return current.y + step * current.tangent
        q = (y[:-1] - current.y - past[:, None] * current.tangent) / past[:, None] ** 2
        weights = np.array(
            [np.prod([(step - b) / (a - b) for b in past if b != a]) for a in past]
        )
        return current.y + step * current.tangent + step**2 * (weights @ q)
