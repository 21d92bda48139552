"""Periodic orbits with any events, by single shooting with the event loop."""

import dataclasses
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import flow, HybridSystem, Settings, SwitchedSystem
from jaxcam.hybrid.sizes import component_sizes
from jaxcam.hybrid.surface import onto_contacts
from jaxcam.parameters import AnyArray
from variational import Orbit
from variational.orbits import direction_of

from .._evaluation import AbstractAtOnce, Evaluation
from .._other_unknowns import AbstractRestated
from .._parameter import as_jax
from .._point import with_field
from .._touch import Touch
from ..problem import AbstractProblem, Monitor, StabilityKind, Start
from ..special import FLIP, flip_direction
from ._by_llvm import evaluated_by_llvm
from ._event_changes import change_between, monitors_of_events, values_of_events
from ._gap_grazing import touching
from ._half_period import WithHalves
from ._return_map import on_hyperplane
from ._run_twice import shooting_twice
from ._shooting_signature import family_of, numbers_in
from ._start_of_period import moved_start, sampled, with_held
from ._states_at_periods import states_at_periods


class SingleShooting(AbstractAtOnce, AbstractRestated):
    """Periodic orbits whose events may change along a branch.

    The unknowns are the state at a fixed phase of the forcing, shape `(n,)`, or,
    without forcing, the state and the period (s), shape `(n + 1,)`. The equations
    require that a simulation return to the state and, without forcing, that the state
    lie in a hyperplane perpendicular to the motion; the hyperplane is updated at each
    point of a branch. One compiled program computes orbits with any number of impacts,
    crossings and sliding phases. The Jacobian contains the saltation matrices of all
    events. Points at which the sequence of events changes are located and named:
    `"grazing"`, `"grazing-sliding"`, `"crossing-sliding"`, `"switching-sliding"`,
    `"adding-sliding"`, `"corner collision"` or `"change of events"`. If the sequence
    changes twice in one step, the second change may be missed.

    Where an impact grazes, the Jacobian is unbounded on one side. In a system with
    switching surfaces, the grazing is therefore located with equations that are smooth
    there, and the branch continues with one impact more or fewer. Follow orbits of
    systems without switching surfaces with [`continuation.ImpactingOrbits`][].

    Examples:
        >>> import continuation
        >>> from jaxcam.models import BilinearOscillator
        >>> system = BilinearOscillator(omega=1.5, amplitude=0.5, damping=0.2)
        >>> orbit = continuation.periodic_orbit(system)
        >>> found = continuation.branch(system, orbit, "omega", (1.4, 1.6))
        >>> type(found.points[0].problem).__name__
        'SingleShooting'
    """

    stability: ClassVar[StabilityKind] = "map"
    """Multipliers on the unit circle mark bifurcations."""
    normal_forms: ClassVar[bool] = False
    """No normal-form coefficients are computed."""
    costly: ClassVar[bool] = True
    """Second derivatives take a long time to compile."""

    parameters: HybridSystem
    """The system."""
    phase: Float[Array, ""]
    """Phase of the forcing at the state (periods); zero without forcing."""
    reference: Float[Array, " n"]
    """State in the hyperplane of the phase condition, shape `(n,)`."""
    normal: Float[Array, " n"]
    """Unit normal of the hyperplane of the phase condition, shape `(n,)`."""
    settings: Settings
    """Accuracy of the simulations."""
    periods: int = eqx.field(static=True)
    """Number of forcing periods after which the orbit repeats; 0 without forcing."""
    turns: int = eqx.field(static=True, default=1)
    """Number of times that an orbit without forcing is traversed: 2 after a flip."""
    shift: AnyArray = eqx.field(default_factory=lambda: np.zeros(()))
    """Time by which the start of the period is delayed (forcing periods), so that no
    impact occurs there.
    """
    passed: AnyArray = eqx.field(default_factory=lambda: np.zeros(()))
    """Number of grazing bifurcations that the branch has passed through."""
    held: tuple[int, ...] = eqx.field(static=True, default=())
    """Constraints with which an orbit is in contact at the start of its period. If it
    is never without contact, the state is moved onto them before each simulation.
    """

    @staticmethod
    def of(
        system: HybridSystem, orbit: Orbit, periods: int, settings: Settings
    ) -> Start:
        """Return the problem of an orbit, with its unknowns.

        Args:
            system: The system.
            orbit: The orbit.
            periods: Its period in forcing periods; 0 without forcing.
            settings: Accuracy of the simulations.

        Returns:
            A [`continuation.Start`][].
        """
        x, length = np.asarray(orbit.state), float(orbit.period)
        phase = 0.0
        if periods:
            phase = float(orbit.time) / float(system.period)  # pyright: ignore
        given = jnp.asarray(phase), jnp.asarray(x), jnp.ones(len(x))
        problem = SingleShooting(system, *given, settings, periods)
        u = x if periods else np.append(x, length)
        problem = with_held(problem, u)
        if periods:
            return Start(problem, u)
        return Start(problem.refreshed(u, system), u)

    def times(self, u, parameters) -> tuple[Array, Array]:
        """Return the times (s) at the start and at the end of the period."""
        if not self.periods:
            return jnp.zeros(()), u[-1]
        period = jnp.asarray(parameters.period, dtype=jnp.float64)
        start = self.phase + self.shift
        return start * period, (start + self.periods) * period

    def state(self, u) -> Float[Array, " n"]:
        """Return the state among the unknowns, shape `(n,)`."""
        return u if self.periods else u[:-1]

    def start(self, u, parameters) -> Float[Array, " n"]:
        """Return the state from which a simulation starts, shape `(n,)`.

        It is the state among the unknowns, moved onto the constraints with which the
        orbit is in contact.
        """
        if not self.held:
            return self.state(u)
        time, _ = self.times(u, parameters)
        given = parameters, time, self.state(u), self.held
        return onto_contacts(*given, self._sizes(u, parameters))

    def residual(self, u, parameters) -> Float[Array, " u"]:
        return self.closing(_end(self._arrival(u, parameters)), u, parameters)

    def _arrival(self, u, parameters):
        x, times = self.start(u, parameters), self.times(u, parameters)
        return flow(parameters, x, *times, settings=self.settings)

    def closing(self, end, u, parameters) -> Float[Array, " u"]:
        """Return the equations, given the state at the end of the period.

        Args:
            end: State at the end of the period, shape `(n,)`.
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            Residuals, shape `(u,)`.
        """
        x = self.state(u)
        off = end - x
        if self.periods:
            return off
        off_plane = jnp.dot(
            self.normal, (x - self.reference) / self._sizes(u, parameters)
        )
        return jnp.append(off, off_plane)

    def linearisation(self, u, parameters, jacobian) -> Float[Array, "k k"]:
        """Return the monodromy matrix or, without forcing, the derivative of the return
        map on the hyperplane.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            The matrix, shape `(n, n)`, or `(n - 1, n - 1)` without forcing.
        """
        n = self.reference.shape[0]
        matrix = jacobian[:n, :n] + jnp.eye(n)
        if self.periods:
            return matrix
        # the last column, for the period, is the rate of change of the state
        return on_hyperplane(
            matrix, jacobian[:n, n], self.normal / self._sizes(u, parameters)
        )

    def scale(self, u, parameters) -> Float[Array, " u"]:
        """Return the scales of the state components and, without forcing, the period.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            Scales, shape `(u,)`.
        """
        sizes = self._sizes(u, parameters)
        return sizes if self.periods else jnp.append(sizes, u[-1])

    def _sizes(self, u, parameters):
        start, end = self.times(u, parameters)
        sizes = component_sizes(parameters, start, self.state(u), end - start)
        sizes = jax.lax.stop_gradient(sizes)
        return jnp.where(sizes > 0, sizes, 1.0)

    def seen(self, u, parameters):
        """Return the monitors of the event counts, and the observed quantities.

        The observed quantities are the period (s), the time (s) and the state at the
        start of the period, the number of impacts and, with forcing, the states at
        integer multiples of the forcing period after that time, `(periods, n)`.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            As for `AbstractProblem.seen`.
        """
        arrival = self._arrival(u, parameters)
        return values_of_events(arrival), self._all_observed(arrival, u, parameters)

    def observed(self, arrival, u, parameters):
        """Return the observed quantities, except for the states at integer multiples of
        the forcing period.
        """
        x, (start, end) = self.state(u), self.times(u, parameters)
        return {
            "period": end - start,
            "time": start,
            "state": x,
            "impacts": arrival.impacts,
        }

    def _all_observed(self, arrival, u, parameters):
        found = self.observed(arrival, u, parameters)
        if self.periods:
            x, times = self.start(u, parameters), self.times(u, parameters)
            found["stroboscopic"] = states_at_periods(self, x, *times, parameters)
        return found

    def evaluated(self, u, p, parameters_at) -> Evaluation:
        """Return all quantities, from one simulation with its derivatives.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            As for `AbstractAtOnce.evaluated`.
        """

        def closed(z):
            u, parameters = z[:-1], parameters_at(z[-1])
            arrival = self._arrival(u, parameters)
            off = self.closing(_end(arrival), u, parameters)
            return off, (off, arrival)

        whole, (off, arrival) = jax.jacfwd(closed, has_aux=True)(jnp.append(u, p))
        parameters = parameters_at(p)
        return Evaluation(
            off,
            whole,
            self.linearisation(u, parameters, whole[:, :-1]),
            values_of_events(arrival),
            self._all_observed(arrival, u, parameters),
        )

    def monitors(self) -> dict[str, Monitor]:
        return monitors_of_events()

    def kind_of_zero(self, name: str, before, after) -> str | None:
        del name
        return change_between(self, before, after)

    def evaluated_on_host(self, leaf: int, z) -> Evaluation | None:
        return evaluated_by_llvm(self, leaf, z)

    # -- between compiled programs

    @property
    def may_touch(self) -> bool:
        """Whether `touching` may find a grazing: true with surfaces and gaps."""
        return isinstance(self.parameters, SwitchedSystem)

    def touching(self, context, at, reach: float) -> Touch | None:
        """Return the grazing ahead of an orbit on its branch, within `reach`, or None.

        Args:
            context: Constants of the branch.
            at: The orbit.
            reach: Distance, measured like the length of a step.

        Returns:
            A `Touch`, or None.
        """
        if not self.may_touch:
            return None
        return touching(self, context, at, reach)

    def restated(self, leaf, z, before):
        if not (self.may_touch and self.periods):
            return None
        return moved_start(self, leaf, z, before)

    def stored(self, observed, u):
        return sampled(self, observed, u) if float(self.shift) else observed

    def beyond(self) -> "SingleShooting":
        """Return the same problem for the orbits beyond a grazing.

        Returns:
            A `SingleShooting`.
        """
        return with_field(self, "passed", np.asarray(float(self.passed) + 1.0))

    @property
    def representation(self) -> WithHalves:
        """The representation of an orbit, regardless of the grazings passed."""
        return WithHalves(family_of(self), problem=self)

    def refreshed(self, u, parameters) -> "SingleShooting":
        if self.periods:
            return self
        u, system = jnp.asarray(u), as_jax(parameters)
        normal = direction_of(system, u[:-1], jnp.zeros(()), u[-1], self.settings)
        # keep the sign of the normal, so that the test functions are continuous
        normal = jnp.where(normal @ self.normal < 0, -normal, normal)
        return dataclasses.replace(self, reference=u[:-1], normal=normal)

    def check(self, point: Any) -> str | None:
        if not self.periods and not point.state[-1] > 0:
            return "the period is not positive"
        return None

    def transition(self, point: Any, at: Any) -> Start | None:
        if point.kind != FLIP:
            return None
        return shooting_twice(self, point, flip_direction(at.linearisation))

    @property
    def signature(self) -> str:
        passed = int(self.passed)
        return family_of(self) + (f" grazings {passed}" if passed else "")

    def with_signature(self, signature: str) -> AbstractProblem:
        found = numbers_in(signature)
        if found is None:
            return super().with_signature(signature)
        return dataclasses.replace(self, **found)


def _end(arrival) -> Float[Array, " n"]:
    """Return the state at the end of a period, NaN if the motion failed."""
    return jnp.where(arrival.code == 0, arrival.state, jnp.nan)
