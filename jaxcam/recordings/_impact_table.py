"""Impacts that were measured one by one: a row for each, speeds before and after."""

import dataclasses

import numpy as np
from jaxtyping import Float


@dataclasses.dataclass(frozen=True)
class Bodies:
    """Two bodies that hit each other: velocities along the normal, masses if known."""

    before: Float[np.ndarray, "k 2"]
    """Velocities, shape `(k, 2)`."""
    after: Float[np.ndarray, "k 2"]
    """Velocities, shape `(k, 2)`."""
    mass: Float[np.ndarray, "k 2"] | None = None
    """Of both (kg), shape `(k, 2)`, or `None`."""


@dataclasses.dataclass(frozen=True)
class ImpactTable:
    """Measured impacts, shape `(k,)` each."""

    name: str
    approach: Float[np.ndarray, " k"]
    """Relative speeds along the normal, in `unit`."""
    separation: Float[np.ndarray, " k"]
    """Relative speeds along the normal, in `unit`."""
    unit: str = "m/s"
    approach_stderr: Float[np.ndarray, " k"] | None = None
    """Their standard errors, or `None`."""
    separation_stderr: Float[np.ndarray, " k"] | None = None
    """Their standard errors, or `None`."""
    bodies: Bodies | None = None
    """Of two bodies, what both did; `None` where one hits something fixed."""
    time: Float[np.ndarray, " k"] | None = None
    """Seconds, or `None`."""
    notes: tuple[str, ...] = ()
    """What was left out of the file, in words."""

    def __len__(self) -> int:
        return len(self.approach)
