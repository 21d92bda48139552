"""Sections, which define the points at which a motion is sampled."""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import numpy as np
from equinox import AbstractVar

from ._samples import Samples


class AbstractSection(eqx.Module):
    """A sampling method for many motions of one system.

    The samples of a motion depend only on its start and its parameters, not on the
    other motions; the rest of the package relies on this.
    """

    system: AbstractVar[Any]
    """The system, whose leaves are the parameters."""
    regular: AbstractVar[bool]
    """Whether samples are one period apart, so that n in a label P(m, n) is in
    periods.
    """
    impacting: AbstractVar[bool]
    """Whether impacts are counted."""

    @abc.abstractmethod
    def sample(
        self,
        states,
        turns: int,
        keep: int,
        *,
        where: Callable | str | None = None,
        values=None,
    ) -> Samples:
        """Return the last `keep` points within `turns` periods.

        Args:
            states: Initial state of each motion, shape `(motions, n)`.
            turns: Number of periods.
            keep: Number of points.
            where: Selects one or more parameters: `lambda s: s.speed`, or `"speed"`.
            values: Value of the parameter of each motion, shape `(motions,)`, or one
                row of values per motion.

        Returns:
            [`jaxcam.sweeps.sections.Samples`][]. A motion whose initial state is
                inadmissible has the code `BEHIND` and no points.
        """

    @abc.abstractmethod
    def starts(self, where: Callable | None = None, values=None) -> np.ndarray:
        """Return the default initial state of each motion.

        Returns:
            States, shape `(motions, n)`.

        Raises:
            ValueError: The system has no default start.
        """

    @abc.abstractmethod
    def turn(self, where: Callable | None = None, values=None) -> np.ndarray:
        """Return the length of a period (s, or iterations of a map).

        Returns:
            Lengths, shape `(motions,)`, or `(1,)` if they are equal.
        """

    def sizes(
        self,
        states,
        samples: Samples,
        where: Callable | None = None,
        values=None,
    ) -> np.ndarray:
        """Return the scale of each component of each motion.

        Two states are equal if their difference is small compared with this scale. The
        default is the largest value among the initial states (`states`) and the
        samples.

        Returns:
            Scales, shape `(motions, n)`.
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
        """Return the name and unit of each of the `n` components of a state."""


def system_names(system, n: int) -> tuple[tuple[str, str], ...]:
    """Return names and units declared by the class of a system; default: x1, x2, ..."""
    names = tuple(getattr(system, "state_names", ()))
    units = tuple(getattr(system, "state_units", ()))
    made = [names[i] if i < len(names) else f"x{i + 1}" for i in range(n)]
    dashes = ("-",) * (n - len(units))
    return tuple(zip(made, (*units[:n], *dashes), strict=True))


def component_coordinates(components) -> dict:
    """Return names and units of the state components, as coordinates of a dataset."""
    # the Zarr format specifies strings of variable length, but not of fixed length
    names = np.array([name for name, _ in components], dtype=object)
    units = np.array([unit for _, unit in components], dtype=object)
    return {
        "component": ("component", names, {}),
        "component_unit": ("component", units, {}),
    }
