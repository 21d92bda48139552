"""Periodic orbits with impacts as a continuation problem."""

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from variational import orbits
from variational.orbits import inadmissible, Shooting

from ..problem import AbstractProblem, LocalDynamics, Monitor, StabilityKind, Start
from ..special import FLIP
from ._impact_sequences import ImpactSequences
from ._orbit_grazing import orbit_grazing
from ._run_twice import run_twice
from ._shooting_graze import multipliers_of
from ._watched import Watched, watched_of


class ImpactingOrbits(AbstractProblem):
    """Periodic orbits of a hybrid system with a known sequence of impacts.

    The unknowns and equations are those of [`variational.orbits.Shooting`][]. For each
    impact, the unknowns are its phase (time in forcing periods) and the state after it,
    with total shape `(m (1 + n),)`. Without impacts, they are the state at time zero,
    shape `(n,)`. For a system without forcing, the first phase is zero, the period (s)
    takes its place, and phases are in periods of the orbit.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> start = continuation.periodic_orbits(system, orbit)
        >>> start.problem.constraints, start.state.shape
        ((0,), (3,))
    """

    stability: ClassVar[StabilityKind] = "map"
    """Multipliers on the unit circle mark bifurcations."""
    costly: ClassVar[bool] = True
    """Second derivatives take a long time to compile."""

    parameters: HybridSystem
    """The [`jaxcam.hybrid.HybridSystem`][]."""
    constraints: tuple[int, ...] = eqx.field(static=True)
    """Constraint hit by each impact, in order."""
    periods: int = eqx.field(static=True)
    """Number of forcing periods after which the orbit repeats; 0 without forcing."""
    dimension: int = eqx.field(static=True)
    """Number of states n."""
    steps: int = eqx.field(static=True, default=32)
    """Number of eighth-order Runge-Kutta steps in each flight."""

    def __check_init__(self):
        if self.periods == 0 and not self.constraints:
            raise ValueError(
                "an orbit without forcing and impacts has no Poincaré section; follow "
                "it as a smooth limit cycle"
            )

    @staticmethod
    def of(system: HybridSystem, equations: Shooting) -> "ImpactingOrbits":
        """Return the problem with these equations.

        Args:
            system: The system.
            equations: The equations of multiple shooting.

        Returns:
            An `ImpactingOrbits`.
        """
        e = equations
        return ImpactingOrbits(system, e.constraints, e.periods, e.dimension, e.steps)

    @property
    def equations(self) -> Shooting:
        """The equations of multiple shooting."""
        return Shooting(self.constraints, self.periods, self.dimension, self.steps)

    def residual(self, u, parameters) -> Float[Array, " n"]:
        return self.equations.residual(u, parameters)

    def linearisation(self, u, parameters, jacobian) -> Float[Array, "k k"]:
        """Return the monodromy matrix for the state just after the first impact.

        Without forcing, it is that of the return map to the constraint.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            The matrix, shape `(k, k)`.
        """
        if not self.constraints:
            return jacobian + jnp.eye(self.dimension)
        matrix = orbits.monodromy_of(self.equations, u, parameters)
        return self._returned(u, parameters, matrix)

    def _returned(self, u, parameters, matrix):
        if self.periods:
            return matrix
        return orbits.return_map(self.equations, u, parameters, matrix)

    def local_dynamics(self, u, parameters) -> LocalDynamics:
        """Return the map from the first impact to the one a period later.

        It acts on the phase of the impact and the state after it, or only on the state
        if there is no forcing.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            A `LocalDynamics`.
        """
        jacobian, at = orbits.around_the_period(self.equations, u, parameters)
        return LocalDynamics(at, None, jacobian)

    def derivatives(self, u, p, parameters_at):
        """Return both derivatives from one Jacobian of each flight.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            As for `AbstractProblem.derivatives`.
        """
        if not self.constraints:
            return AbstractProblem.derivatives(self, u, p, parameters_at)
        whole, matrix = orbits.equations_and_monodromy(
            self.equations, u, p, parameters_at
        )
        return whole, self._returned(u, parameters_at(p), matrix)

    # -- monitors

    def monitors(self) -> Mapping[str, Monitor]:
        m = len(self.constraints)

        def monitor(one: Watched) -> Monitor:
            if one.what == "gap":
                return Monitor("grazing", ends=True)
            # so are the gaps of the flights next to an impact of zero speed
            beside = ((one.number - 1) % m, one.number)
            names = tuple(Watched("gap", k).name for k in beside)
            return Monitor("grazing", ends=True, vanishing=names)

        return {name: monitor(one) for name, one in watched_of(m).items()}

    def watched(self, number, u, parameters) -> Float[Array, ""]:
        flights = max(len(self.constraints), 1)
        if isinstance(number, int) and number >= flights:
            return self.equations.approach(u, parameters)[number - flights]
        return self.equations.gap_or_speed(jnp.asarray(number), u, parameters)

    def seen(self, u, parameters):
        """Return the monitors and the observed quantities.

        The observed quantities are the period (s), the time (s) and state after the
        first impact, the integration error, the scale of the gaps in their units and,
        with forcing, the states at whole forcing periods, `(periods, n)`.

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
        if self.periods:
            found["stroboscopic"] = equations.stroboscopic(u, parameters, seen)
        rows = {"gap": seen.gaps, "speed": seen.speeds}
        monitors = {
            name: rows[what][k]
            for name, (what, k) in watched_of(len(self.constraints)).items()
        }
        return monitors, found

    # -- between compiled programs

    def refused(self, monitors, observed) -> str | None:
        """Return the reason why a solution is not admissible, or None.

        On a curve of grazing orbits, the monitor that is zero along it is not checked.

        Returns:
            A sentence, or None.
        """
        known = watched_of(len(self.constraints))
        gaps, speeds = (
            {
                watched.number: monitors[name]
                for name, watched in known.items()
                if watched.what == what and name in monitors
            }
            for what in ("gap", "speed")
        )
        return inadmissible(
            gaps,
            speeds,
            observed["integration error"],
            gap_size=observed["gap size"],
            period=observed["period"],
            steps=self.steps,
        )

    def check(self, point: Any) -> str | None:
        return self.refused(point.tests, point.observed)

    def transition(self, point: Any, at: Any) -> Start | None:
        del at
        if point.kind == FLIP:
            return self._doubled(point)
        return orbit_grazing(self, point)

    def _doubled(self, point: Any) -> Start:
        u = jnp.asarray(point.state)
        parameters = point.problem.parameters
        matrix = np.asarray(_antiperiodic(self.equations, u, parameters))
        deviation = np.linalg.svd(matrix)[2][-1]
        state, tangent = run_twice(self, np.asarray(point.state), deviation)
        twice = ImpactingOrbits(
            parameters,
            2 * self.constraints,
            2 * self.periods,
            self.dimension,
            self.steps if self.constraints else 2 * self.steps,
        )
        return Start(twice, state, float(point.parameter), np.append(tangent, 0.0))

    def eigenvalues(self, u, parameters, at):
        return multipliers_of(self.equations, u, parameters, at)

    @property
    def representation(self) -> "ImpactSequences":
        """The representations of an orbit, one starting at each of its impacts."""
        return ImpactSequences(self.sequence(self.constraints), self)

    def sequence(self, constraints: tuple[int, ...]) -> str:
        """Return the name of the family of orbits with these impacts, in this order.

        Returns:
            The name.
        """
        # results for two numbers of steps differ by the integration error
        return f"impacts {constraints} periods {self.periods}"

    @property
    def signature(self) -> str:
        hits = ".".join(map(str, self.constraints)) or "-"
        return f"impacts {hits} periods {self.periods} steps {self.steps}"

    def with_signature(self, signature: str) -> AbstractProblem:
        words = signature.split()
        if words[0::2] != ["impacts", "periods", "steps"]:
            return super().with_signature(signature)
        hits = () if words[1] == "-" else tuple(map(int, words[1].split(".")))
        periods, steps = int(words[3]), int(words[5])
        return ImpactingOrbits(self.parameters, hits, periods, self.dimension, steps)


_antiperiodic = eqx.filter_jit(orbits.antiperiodic)
