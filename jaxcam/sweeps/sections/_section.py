"""Define sections, the points at which a motion is sampled."""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import numpy as np
from equinox import AbstractVar

from ._samples import Samples


class AbstractSection(eqx.Module):
    """A sampling method for many motions of one system.

    A lane is one motion. Its samples depend on its start and its parameters alone, not
    on the other lanes; everything else in this package relies on that.
    """

    system: AbstractVar[Any]
    """Its leaves are the parameters."""
    regular: AbstractVar[bool]
    """Whether samples are one period apart, so that a label P(m, n) means n periods."""
    impacting: AbstractVar[bool]
    """Whether impacts are counted."""

    @abc.abstractmethod
    def sample(
        self,
        states,
        turns: int,
        keep: int,
        *,
        where: Callable | None = None,
        values=None,
    ) -> Samples:
        """Return the last `keep` points within `turns` periods.

        Args:
            states: Initial state of each lane, shape `(lanes, n)`.
            turns: Number of periods.
            keep: Number of points.
            where: Picks a parameter, or several.
            values: Value of the parameter in each lane, shape `(lanes,)`, or one row
                per lane.

        Returns:
            [`jaxcam.sweeps.sections.Samples`][]. A lane that cannot start has the code
                `BEHIND` and no points.
        """

    @abc.abstractmethod
    def starts(self, where: Callable | None = None, values=None) -> np.ndarray:
        """Return the default start of each lane.

        Returns:
            Shape `(lanes, n)`.

        Raises:
            ValueError: The system has no default start.
        """

    @abc.abstractmethod
    def turn(self, where: Callable | None = None, values=None) -> np.ndarray:
        """Return the length of a period (s, or iterations).

        Returns:
            Shape `(lanes,)`, or `(1,)` for all.
        """

    def sizes(
        self,
        states,
        samples: Samples,
        where: Callable | None = None,
        values=None,
    ) -> np.ndarray:
        """Return the scale of each component in each lane.

        Two states are equal if their difference is small compared with it. By
        default the largest value among the start (`states`) and the samples.

        Returns:
            Shape `(lanes, n)`.
        """
        del where, values
        seen = np.where(np.isfinite(samples.states), np.abs(samples.states), 0.0)
        start = np.abs(np.nan_to_num(np.asarray(states, dtype=float)))
        return np.maximum(start, seen.max(axis=1))

    @abc.abstractmethod
    def lifted(self, states, where: Callable | None = None, values=None) -> np.ndarray:
        """Return the states, moved out of a constraint that a parameter has shifted."""

    @abc.abstractmethod
    def names(self, n: int) -> tuple[tuple[str, str], ...]:
        """Return name and unit of each of the `n` components of a state."""


def system_names(system, n: int) -> tuple[tuple[str, str], ...]:
    """Return names and units declared by the class of a system; default x1, x2, ..."""
    names = tuple(getattr(system, "state_names", ()))
    units = tuple(getattr(system, "state_units", ()))
    made = [names[i] if i < len(names) else f"x{i + 1}" for i in range(n)]
    dashes = ("-",) * (n - len(units))
    return tuple(zip(made, (*units[:n], *dashes), strict=True))


def component_coordinates(components) -> dict:
    """Return names and units of the state components, as coordinates of a dataset."""
    # Zarr specifies strings of variable length, but not of fixed length
    names = np.array([name for name, _ in components], dtype=object)
    units = np.array([unit for _, unit in components], dtype=object)
    return {
        "component": ("component", names, {}),
        "component_unit": ("component", units, {}),
    }
