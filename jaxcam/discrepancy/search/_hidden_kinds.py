"""Kinds of hidden elements, with their fitted parameters and their signals."""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Sequence

import jax.numpy as jnp
import numpy as np

from ..terms import HiddenElement, Hysteresis, Relaxation, Resonator
from ._hidden_signals import (
    Driven,
    hysteresis_signals,
    relaxation_signals,
    resonance_signals,
)


@dataclasses.dataclass(frozen=True)
class Number:
    """A parameter of an element: its name, its bounds, and its largest change in one
    fit.

    If `logarithm` is true, the logarithm of the parameter is fitted.
    """

    name: str
    low: float
    high: float
    reach: float
    logarithm: bool = True

    def moved(self, value: float, change: float) -> float:
        new = value * math.exp(change) if self.logarithm else value + change
        return min(max(new, self.low), self.high)

    def near(self, value: float, change):
        """Return the parameter after a small change, as a differentiable function."""
        return value * jnp.exp(change) if self.logarithm else value + change

    def change(self, old: float, new: float) -> float:
        return math.log(new / old) if self.logarithm else new - old

    def span(self, value: float, reach: float) -> tuple[float, float]:
        """Return the smallest and largest change, within the reach and the bounds."""
        ends = (self.moved(value, sign * reach) for sign in (-1.0, 1.0))
        low, high = (self.change(value, end) for end in ends)
        return low, high

    def error(self, value: float, stderr: float) -> float:
        """Return the standard error of the parameter, from that of its change."""
        return value * stderr if self.logarithm else stderr


@dataclasses.dataclass(frozen=True)
class Kind:
    """A kind of element.

    - `name`: its name in sentences; `element`: the function that creates an element
      from its parameters; `numbers`: its parameters; `outputs`: names of its strengths;
      `starts`: number of its free motions, which depend on the initial state.
    - `signals(driven, cells)`: yields, for each set of parameters, the outputs `(r, n,
      o)` and free motions `(r, n, s)`.
    """

    name: str
    element: Callable[..., HiddenElement]
    numbers: tuple[Number, ...]
    outputs: tuple[str, ...]
    starts: int
    signals: Callable[
        [Driven, Sequence[Sequence[float]]], Iterable[tuple[np.ndarray, np.ndarray]]
    ]

    def reach(self, number: Number, values: Sequence[float]) -> float:
        """Return the largest change of a parameter in one fit; for the frequency of a
        resonance, this is a fraction of the width of the resonance.
        """
        if self is RESONANCE and number.name == "frequency":
            return number.reach * values[1]
        return number.reach


# the signals of all cells at once would need hundreds of megabytes
def _resonances(driven: Driven, cells):
    return (resonance_signals(driven, *cell) for cell in cells)


def _relaxations(driven: Driven, cells):
    return (relaxation_signals(driven, *cell) for cell in cells)


def _hystereses(driven: Driven, cells, loading: int = 1):
    limits, betas, powers = np.array(cells).T
    return zip(*hysteresis_signals(driven, limits, betas, powers, loading))


RESONANCE = Kind(
    "resonance",
    Resonator,
    (
        Number("frequency", 0.0, math.inf, 0.5),
        Number("ratio", 1e-3, 0.7, 0.5),
    ),
    ("by_state", "by_rate"),
    2,
    _resonances,
)
RELAXATION = Kind(
    "relaxation",
    Relaxation,
    (Number("time", 0.0, math.inf, 0.5),),
    ("by_state",),
    1,
    _relaxations,
)
HYSTERESIS = Kind(
    "hysteresis",
    Hysteresis,
    (
        Number("limit", 0.0, math.inf, 0.4),
        Number("beta", 0.5, 1.5, 0.2, logarithm=False),
        Number("power", 0.5, 6.0, 0.4),
    ),
    ("by_state",),
    1,
    _hystereses,
)
STIFFENING = Kind(
    "stiffening hysteresis",
    functools.partial(Hysteresis, loading=-1),
    (
        Number("limit", 0.0, math.inf, 0.4),
        Number("beta", -6.0, 0.0, 0.5, logarithm=False),
        Number("power", 0.5, 3.0, 0.4),
    ),
    ("by_state",),
    1,
    functools.partial(_hystereses, loading=-1),
)
KINDS = (RESONANCE, RELAXATION, HYSTERESIS, STIFFENING)
