"""Periodic orbits with impacts as a continuation problem."""

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.programs import program
from variational import orbits
from variational.orbits import inadmissible, Shooting

from .._padding import as_compiled, Padded
from ..problem import AbstractProblem, Monitor, Start
from ..special import FLIP
from ._accumulation import accumulation
from ._impact_sequences import ImpactSequences
from ._kinds import orbits_of_kind
from ._orbit_equations import AbstractOrbits, PaddedOrbits
from ._orbit_grazing import orbit_grazing
from ._release import release_of
from ._run_twice import run_twice
from ._shooting_graze import multipliers_of
from ._watched import INTERRUPTION, monitors_of, STICKS, watched_of


_ROWS = 16
"""Programs are compiled for multiples of this number of impacts and periods."""


class ImpactingOrbits(AbstractOrbits):
    """Periodic orbits of a hybrid system with a known sequence of impacts.

    The unknowns and equations are those of [`variational.orbits.Shooting`][]. For each
    impact, the unknowns are its phase (time in forcing periods) and the state after it;
    for m impacts of a system with n states, their shape is `(m (1 + n),)`. Without
    impacts, they are the state at time zero, shape `(n,)`. For a system without
    forcing, the first phase is zero, the period (s) takes its place, and phases are in
    periods of the orbit.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> start = continuation.periodic_orbits(system, orbit)
        >>> start.problem.constraints, start.state.shape
        ((0,), (3,))
    """

    parameters: HybridSystem
    """The [`jaxcam.hybrid.HybridSystem`][]."""
    constraints: tuple[int, ...] = eqx.field(static=True)
    """Constraint hit at each impact, in order."""
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

    def padded(self) -> Padded | None:
        m, row = len(self.constraints), 1 + self.dimension
        if not m:
            return None
        rows, periods = (-(-number // _ROWS) * _ROWS for number in (m, self.periods))
        wide = PaddedOrbits(self.parameters, self.equations.padded(rows, periods))
        lengths = {"stroboscopic": self.periods}
        return Padded(wide, np.arange(m * row), rows * row, lengths)

    # -- monitors

    def monitors(self) -> Mapping[str, Monitor]:
        return monitors_of(len(self.constraints))

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

    def accumulation(self, points: Sequence[Any]) -> Start | None:
        found = accumulation(self, points)
        if found is None:
            return None
        system, value, distance = found
        problem = orbits_of_kind(STICKS, system, self.periods)
        state = release_of(system)
        tangent = np.append(np.zeros_like(state), np.sign(distance))
        step = abs(distance) / float(points[-1].scale[-1])
        reason = (
            "infinitely many grazing bifurcations, each with one more impact, "
            "accumulate here; continued with the orbit that sticks"
        )
        return Start(problem, state, value, tangent, step, reason, INTERRUPTION)

    def _doubled(self, point: Any) -> Start:
        u = jnp.asarray(point.state)
        parameters = point.problem.parameters
        wide, v = as_compiled(self, u)
        # the rows and columns of padding come last
        matrix = np.asarray(_antiperiodic(wide.equations, v, parameters))
        matrix = matrix[: u.size, : u.size]
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
        return multipliers_of(self, u, parameters, at)

    @property
    def representation(self) -> "ImpactSequences":
        """The representations of an orbit, one starting at each of its impacts."""
        return ImpactSequences(self.sequence(self.constraints), self)

    def sequence(self, constraints: tuple[int, ...]) -> str:
        """Return the name of the family of orbits with these impacts, in this order.

        Returns:
            The name.
        """
        # the number of steps is omitted, because it only changes the integration error
        return f"impacts {constraints} periods {self.periods}"

    @property
    def signature(self) -> str:
        hits = ".".join(map(str, self.constraints)) or "-"
        return f"impacts {hits} periods {self.periods} steps {self.steps}"

    def with_signature(self, signature: str) -> AbstractProblem:
        words = signature.split()
        if words[:1] == [STICKS]:
            sticking = orbits_of_kind(STICKS, self.parameters, self.periods)
            return sticking.with_signature(signature)
        if words[0::2] != ["impacts", "periods", "steps"]:
            return super().with_signature(signature)
        hits = () if words[1] == "-" else tuple(map(int, words[1].split(".")))
        periods, steps = int(words[3]), int(words[5])
        return ImpactingOrbits(self.parameters, hits, periods, self.dimension, steps)


_antiperiodic = program(orbits.antiperiodic)
