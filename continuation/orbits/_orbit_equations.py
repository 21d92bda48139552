"""Equations of periodic orbits with impacts, and the quantities observed on them."""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from variational import orbits
from variational.orbits import AbstractShooting

from ..problem import AbstractProblem, LocalDynamics, StabilityKind
from ._watched import watched_of


class AbstractOrbits(AbstractProblem):
    """Periodic orbits that solve the equations of multiple shooting."""

    stability: ClassVar[StabilityKind] = "map"
    """Multipliers on the unit circle mark bifurcations."""
    costly: ClassVar[bool] = True
    """Second derivatives take a long time to compile."""

    parameters: eqx.AbstractVar[HybridSystem]

    @property
    @abc.abstractmethod
    def equations(self) -> AbstractShooting:
        """The equations of multiple shooting."""

    def residual(self, u, parameters) -> Float[Array, " n"]:
        return self.equations.residual(u, parameters)

    def linearisation(self, u, parameters, jacobian) -> Float[Array, "k k"]:
        """Return the monodromy matrix for the state just after the first impact.

        Without forcing, return the derivative of the return map to the constraint.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            The matrix, shape `(k, k)`.
        """
        if not self.equations.rows:
            return jacobian + jnp.eye(self.equations.dimension)
        matrix = orbits.monodromy_of(self.equations, u, parameters)
        return self._returned(u, parameters, matrix)

    def _returned(self, u, parameters, matrix):
        if self.equations.forced:
            return matrix
        return orbits.return_map(self.equations, u, parameters, matrix)

    def local_dynamics(self, u, parameters) -> LocalDynamics:
        """Return the map from the first impact to the impact one period later.

        The map acts on the phase of the impact and the state after it, or only on the
        state if there is no forcing.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            A `LocalDynamics`.
        """
        jacobian, at = orbits.around_the_period(self.equations, u, parameters)
        return LocalDynamics(at, None, jacobian)

    def derivatives(self, u, p, parameters_at):
        """Return the derivative of the residual and the monodromy matrix.

        Both follow from one Jacobian of each flight.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            As for `AbstractProblem.derivatives`.
        """
        if not self.equations.rows:
            return AbstractProblem.derivatives(self, u, p, parameters_at)
        whole, matrix = orbits.equations_and_monodromy(
            self.equations, u, p, parameters_at
        )
        return whole, self._returned(u, parameters_at(p), matrix)

    def watched(self, number, u, parameters) -> Float[Array, ""]:
        flights = max(self.equations.rows, 1)
        if isinstance(number, int) and number >= flights:
            return self.equations.approach(u, parameters)[number - flights]
        return self.equations.gap_or_speed(jnp.asarray(number), u, parameters)

    def seen(self, u, parameters):
        """Return the monitors and the observed quantities.

        The observed quantities are the period (s), the time (s) and state after the
        first impact, the integration error, the scale of the gaps (in their unit)
        and, with forcing, the states at integer multiples of the forcing period,
        `(periods, n)`.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            As for `AbstractProblem.seen`.
        """
        equations = self.equations
        seen = equations.seen(u, parameters)
        start = equations.flights(u, parameters)[0][0]
        found = {
            "period": equations.period(u, parameters),
            "time": start[0],
            "state": start[1:],
            "integration error": seen.error,
            "gap size": seen.gap_size,
        }
        if self.equations.forced:
            found["stroboscopic"] = equations.stroboscopic(u, parameters, seen)
        rows = {"gap": seen.gaps, "speed": seen.speeds}
        monitors = {
            name: rows[what][k]
            for name, (what, k) in watched_of(self.equations.rows).items()
        }
        return monitors, found

    def scale(self, u, parameters) -> Float[Array, " u"]:
        """Return the scales of the unknowns, computed without the padding.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            Shape `(u,)`.
        """
        del parameters
        # unknowns of padding are zero, and do not contribute to the sum
        mean = jnp.sum(u * u) / self.number_of_unknowns(u)
        size = jnp.maximum(1.0, jnp.sqrt(mean))
        return jnp.broadcast_to(size, u.shape)

    def number_of_unknowns(self, u):
        equations = self.equations
        if not equations.rows:
            return u.size
        return jnp.asarray(equations.number * (1 + equations.dimension), jnp.float64)


class PaddedOrbits(AbstractOrbits):
    """Orbits with any number of impacts up to the number of rows.

    Only compiled programs use this problem; everywhere else, the problem is a
    [`continuation.ImpactingOrbits`][].
    """

    parameters: HybridSystem
    shooting: orbits.PaddedShooting

    @property
    def equations(self) -> orbits.PaddedShooting:
        """The equations of multiple shooting."""
        return self.shooting
