"""A table of measured impacts, with the speeds before and after."""

import dataclasses

import numpy as np
from jaxtyping import Float


@dataclasses.dataclass(frozen=True)
class Bodies:
    """Velocities of two colliding bodies along the normal, and their masses if
    known.
    """

    before: Float[np.ndarray, "k 2"]
    """Velocities before the impacts, shape `(k, 2)`."""
    after: Float[np.ndarray, "k 2"]
    """Velocities after the impacts, shape `(k, 2)`."""
    mass: Float[np.ndarray, "k 2"] | None = None
    """Masses of the two bodies (kg), shape `(k, 2)`, or `None`."""


@dataclasses.dataclass(frozen=True)
class ImpactTable:
    """Measured impacts.

    Examples:
        >>> from jaxcam.recordings import ImpactTable
        >>> table = ImpactTable("drops", np.array([1.0, 2.0]), np.array([0.8, 1.5]))
        >>> (table.separation / table.approach).tolist()
        [0.8, 0.75]
    """

    name: str
    """Name of the table."""
    approach: Float[np.ndarray, " k"]
    """Relative approach speeds along the normal, in `unit`, shape `(k,)`."""
    separation: Float[np.ndarray, " k"]
    """Relative separation speeds along the normal, in `unit`, shape `(k,)`."""
    unit: str = "m/s"
    """Unit of the speeds."""
    approach_stderr: Float[np.ndarray, " k"] | None = None
    """Standard errors of the approach speeds, or `None`."""
    separation_stderr: Float[np.ndarray, " k"] | None = None
    """Standard errors of the separation speeds, or `None`."""
    bodies: Bodies | None = None
    """Velocities of both bodies; `None` for impacts on a fixed surface."""
    time: Float[np.ndarray, " k"] | None = None
    """Times (s), or `None`."""
    notes: tuple[str, ...] = ()
    """Remarks on omitted rows of the file."""

    def __len__(self) -> int:
        return len(self.approach)
