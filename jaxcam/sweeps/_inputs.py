"""Check the inputs of sweeps."""

import numpy as np

from ..hybrid import HybridSystem
from .sections import AbstractSection, Stroboscopic


LANES = 4096
"""Default number of motions in a block."""


def as_section(system) -> AbstractSection:
    """Return a section unchanged, or the stroboscopic section of a hybrid system.

    Raises:
        ValueError: The argument is neither of these, or the system has no period.
    """
    if isinstance(system, AbstractSection):
        section = system
    elif isinstance(system, HybridSystem):
        section = Stroboscopic(system)
    else:
        raise ValueError(
            f"a {type(system).__name__} cannot be swept; pass a hybrid system, or a "
            "section such as Stroboscopic(system) or Map(function, parameters)"
        )
    if isinstance(section.system, HybridSystem):
        section.system.check()
        if section.system.period is None and getattr(section, "period", 0) is None:
            raise ValueError(
                "this system has no forcing period; pass "
                "Stroboscopic(system, period=...) with a period in seconds"
            )
    return section


def check_turns(
    turns: int, keep: int, period_tolerance: float, reruns: int = 0
) -> None:
    """Raise `ValueError` for numbers that are invalid or inconsistent."""
    if not 1 <= keep <= turns:
        raise ValueError(
            f"keep is {keep} and turns is {turns}; keep at least 1 of these periods"
        )
    if not 0 < period_tolerance < 1:
        raise ValueError(
            f"period_tolerance is {period_tolerance:g}; give a number in (0, 1), "
            "such as 1e-6"
        )
    if reruns < 0:
        raise ValueError(f"reruns is {reruns}; give 0 or more")


def check_regular(section: AbstractSection, needs: str) -> None:
    """Raise `ValueError` for a section that is not sampled once per period; `needs` is
    the beginning of the message, such as "basins need".
    """
    if not section.regular:
        raise ValueError(
            f"{needs} a section that is sampled once per period, and a "
            f"{type(section).__name__} is not; pass the system itself"
        )


def as_values(values) -> np.ndarray:
    """Return values of a parameter, shape `(points,)`."""
    values = np.asarray(values, dtype=float)
    if values.ndim != 1 or not len(values):
        raise ValueError(f"values has shape {values.shape}; give a vector")
    if not np.all(np.isfinite(values)):
        raise ValueError("a value is not finite; all parameter values must be finite")
    return values


def as_starts(section: AbstractSection, states, where, values) -> np.ndarray:
    """Return the initial states of each point, shape `(points, starts, n)`.

    `states` is None for the default of the section, or has shape `(n,)`, `(starts, n)`
    or `(points, starts, n)`.
    """
    points = len(values)
    if states is None:
        return section.starts(where, values)[:, None, :]
    states = np.asarray(states, dtype=float)
    if states.ndim < 3:
        states = np.broadcast_to(np.atleast_2d(states), (points, *_two(states)))
    if states.ndim != 3 or states.shape[0] != points or 0 in states.shape:
        raise ValueError(
            f"states has shape {states.shape}; give (n,), (starts, n), or (points, "
            f"starts, n) for {points} points"
        )
    return states


def _two(states) -> tuple[int, int]:
    if states.ndim == 0 or 0 in states.shape:
        raise ValueError(f"states has shape {states.shape}; give (n,) or (starts, n)")
    return (1, len(states)) if states.ndim == 1 else states.shape
