"""Impacts that were measured one by one: a row for each, speeds before and after."""

import dataclasses

import numpy as np
from jaxtyping import Float


@dataclasses.dataclass(frozen=True)
class Bodies:
    """Two bodies that hit each other: velocities along the normal, masses if known.

    - `before`, `after`: velocities, shape `(k, 2)`.
    - `mass`: of both (kg), shape `(k, 2)`, or `None`.
    """

    before: Float[np.ndarray, "k 2"]
    after: Float[np.ndarray, "k 2"]
    mass: Float[np.ndarray, "k 2"] | None = None


@dataclasses.dataclass(frozen=True)
class ImpactTable:
    """Measured impacts, shape `(k,)` each.

    - `approach`, `separation`: relative speeds along the normal, in `unit`.
    - `approach_stderr`, `separation_stderr`: their standard errors, or `None`.
    - `bodies`: of two bodies, what both did; `None` where one hits something fixed.
    - `time`: seconds, or `None`.
    - `notes`: what was left out of the file, in words.
    """

    name: str
    approach: Float[np.ndarray, " k"]
    separation: Float[np.ndarray, " k"]
    unit: str = "m/s"
    approach_stderr: Float[np.ndarray, " k"] | None = None
    separation_stderr: Float[np.ndarray, " k"] | None = None
    bodies: Bodies | None = None
    time: Float[np.ndarray, " k"] | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.approach)
