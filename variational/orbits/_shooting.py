"""Shooting equations of orbits with a known impact sequence, padded or not."""

import equinox as eqx
import numpy as np

from jaxcam.parameters import AnyArray

from ._shooting_equations import AbstractShooting


class Shooting(AbstractShooting):
    """The multiple-shooting equations of a periodic orbit with a known sequence of
    impacts (thesis, eq. 3.42).

    The unknowns u are, for each impact, its phase (time in forcing periods) and the
    state after it; for m impacts of a system with n states, their shape is
    `(m (1 + n),)`. Without impacts, they are the state at time zero, shape `(n,)`. For
    a system without forcing, the first phase is zero, the period (s) takes its place,
    and phases are in periods of the orbit.
    """

    constraints: tuple[int, ...] = eqx.field(static=True)
    """Constraint hit at each impact, in order."""
    periods: int = eqx.field(static=True)
    """Number of forcing periods after which the orbit repeats; 0 without forcing."""
    dimension: int = eqx.field(static=True)
    """Number of states n."""
    steps: int = eqx.field(static=True, default=32)
    """Number of eighth-order Runge-Kutta steps in each flight."""

    @property
    def forced(self) -> bool:
        """Whether the system is forced."""
        return self.periods > 0

    @property
    def most_periods(self) -> int:
        """Number of forcing periods."""
        return self.periods

    @property
    def rows(self) -> int:
        """Number of impacts."""
        return len(self.constraints)

    @property
    def number(self) -> int:
        """Number of impacts."""
        return len(self.constraints)

    @property
    def hits(self) -> AnyArray:
        """Constraint hit at each impact, shape `(m,)`."""
        return np.array(self.constraints, int)

    def padded(self, rows: int, most_periods: int) -> "PaddedShooting":
        """Return the same equations with this number of rows.

        Args:
            rows: Number of rows, at least the number of impacts. There must be at least
                one impact.
            most_periods: Upper bound on the number of periods.

        Returns:
            A [`variational.orbits.PaddedShooting`][].
        """
        hits = np.zeros(rows, int)
        hits[: self.number] = self.constraints
        periods, number = np.asarray(self.periods), np.asarray(self.number)
        most = most_periods if self.forced else 0
        return PaddedShooting(hits, periods, self.dimension, self.steps, number, most)


class PaddedShooting(AbstractShooting):
    """The equations of [`variational.orbits.Shooting`][] with rows of padding.

    The numbers of impacts and periods and the constraints are arrays, so that orbits
    with different impacts share one compiled program.
    """

    constraints: AnyArray
    """Constraint hit at each impact, then zeros, shape `(rows,)`."""
    periods: AnyArray
    """Number of forcing periods after which the orbit repeats; 0 without forcing."""
    dimension: int = eqx.field(static=True)
    """Number of states n."""
    steps: int = eqx.field(static=True)
    """Number of eighth-order Runge-Kutta steps in each flight."""
    impacts: AnyArray
    """Number of impacts."""
    capacity: int = eqx.field(static=True)
    """Upper bound on the number of periods; 0 without forcing."""

    @property
    def forced(self) -> bool:
        """Whether the system is forced."""
        return self.capacity > 0

    @property
    def most_periods(self) -> int:
        """Upper bound on the number of periods."""
        return self.capacity

    @property
    def rows(self) -> int:
        """Number of rows of unknowns."""
        return self.constraints.shape[0]

    @property
    def number(self) -> AnyArray:
        """Number of impacts."""
        return self.impacts

    @property
    def hits(self) -> AnyArray:
        """Constraint hit at each impact, then zeros, shape `(rows,)`."""
        return self.constraints
