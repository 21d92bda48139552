"""Orbits that stick once in n periods, defined by their release point."""

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import (
    contact_state,
    gaps,
    normal_acceleration,
    normal_velocity,
)
from variational.chatter import (
    ChatterFrame,
    ChatterOrbit,
    frame_at,
    interruption_margin,
    next_impact,
    orbit_from,
)
from variational.orbits import flight_end

from ..problem import AbstractProblem, Monitor, StabilityKind, Start
from ._behind_interruption import orbit_behind
from ._kinds import add_kind
from ._release import release_of
from ._shooting import ImpactingOrbits
from ._watched import INTERRUPTION, STICKS


CHATTER = "chatter margin"
"""Name of the monitor that is zero at an interruption."""
DETACHMENT = "jerk at release"
"""Name of the monitor that is zero at the detachment point."""
# number of eighth-order Runge-Kutta steps from the last impact to a sampling time
_STEPS = 64
# largest number of impacts between release and the end of a period
_IMPACTS = 2000


class StickingOrbits(AbstractProblem):
    """Orbits P(inf, n), which leave contact, chatter and stick once in n periods.

    While the system sticks, it follows the constraint, so its state at release is
    independent of the past: it is given by the time t and the state x at which gap,
    normal velocity and normal acceleration are zero. These three conditions are the
    equations. The unknowns, shape `(3,)`, are the phase of release (time in forcing
    periods) and the state at release. All multipliers are zero. Two monitors determine
    where the orbit exists:

    - the margin of [`variational.chatter_accumulation`][], which is zero if the impacts
        accumulate exactly at the n-th release (an interruption of chatter). The
        sticking time itself is unsuitable as a test function: it falls to zero as a
        power of the distance from this interruption and does not change sign
        (thesis, section 3.5.1). The margin is smooth.
    - the rate of change of the contact acceleration at release, with time measured in
        forcing periods. It is zero at the detachment point (valve float), where release
        and the next return to contact coincide; beyond that point, contact never ends.

    Beyond a zero of the first monitor, a branch continues with
    [`continuation.ImpactingOrbits`][] if `beyond` is set.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> orbit = continuation.periodic_orbit(system)
        >>> type(continuation.periodic_orbits(system, orbit).problem).__name__
        'StickingOrbits'
    """

    stability: ClassVar[StabilityKind] = "map"
    """Multipliers on the unit circle mark bifurcations."""
    normal_forms: ClassVar[bool] = False
    """No normal-form coefficients are computed."""
    detects: ClassVar[bool] = False
    """Folds, branch points and flips are not searched for."""

    parameters: HybridSystem
    """A system with a period, two states and one constraint."""
    periods: int = eqx.field(static=True, default=1)
    """Number n of forcing periods from release to the next release after contact."""
    beyond: bool = eqx.field(static=True, default=False)
    """Whether to continue beyond an interruption; otherwise, the branch ends there."""

    def residual(self, u, parameters) -> Float[Array, "3"]:
        system = parameters.prepared()
        period = system.period
        time, state = u[0] * period, u[1:]
        rows = [
            gaps(system, time, state),
            period * normal_velocity(system, time, state),
            period**2 * normal_acceleration(system, time, state),
        ]
        return jnp.concatenate(rows)

    def linearisation(self, u, parameters, jacobian) -> Float[Array, "2 2"]:
        """Return zeros, because sticking removes every perturbation.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            Zeros, shape `(2, 2)`.
        """
        del parameters, jacobian
        return jnp.zeros((u.shape[0] - 1, u.shape[0] - 1))

    def _frame(self, u, system) -> ChatterFrame:
        return frame_at(system, u[0] * system.period, u[1:])

    def watched(self, number, u, parameters) -> Float[Array, ""]:
        system = parameters.prepared()
        frame = self._frame(u, system)
        if list(self.monitors())[number] == DETACHMENT:
            return frame.jerk * system.period**3
        return -interruption_margin(system, frame, self.periods)

    def monitors(self) -> Mapping[str, Monitor]:
        return {
            CHATTER: Monitor(INTERRUPTION, ends=True, bracket=True),
            DETACHMENT: Monitor("detachment", ends=True),
        }

    def seen(self, u, parameters):
        """Return the monitors and the observed quantities.

        The observed quantities are the period, the release, accumulation and sticking
        times (s), the number of impacts, and the states at integer multiples of the
        forcing period, `(periods, 2)`.

        Args:
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            As for `AbstractProblem.seen`.
        """
        system = parameters.prepared()
        period = jnp.asarray(system.period, dtype=jnp.float64)
        turn = orbit_from(system, self._frame(u, system), self.periods)
        length = self.periods * period
        monitors = {
            CHATTER: -turn.margin,
            DETACHMENT: turn.frame.jerk * period**3,
        }
        observed = {
            "period": length,
            "time": turn.frame.release,
            "state": turn.frame.state,
            "accumulation": turn.accumulation,
            "sticking time": turn.frame.release + length - turn.accumulation,
            "impacts": turn.impacts,
            "stroboscopic": _stroboscopic(system, turn, self.periods),
        }
        return monitors, observed

    def check(self, point: Any) -> str | None:
        value = point.tests.get(CHATTER, np.nan)
        if np.isfinite(value) and value < 0:
            return "chatter is not completed before the release"
        if np.isnan(value) and self.periods > 1:
            return f"contact begins before period {self.periods}, or never"
        if point.tests.get(DETACHMENT, 1.0) < 0:
            return "contact begins, rather than ends, at this zero of its acceleration"
        return None

    def transition(self, point: Any, at: Any) -> Start | None:
        del at
        if self.beyond and point.kind == self.monitors()[CHATTER].kind:
            return orbit_behind(point, self.periods)
        return None

    @property
    def signature(self) -> str:
        if self.periods == 1:
            return f"{STICKS} once per period"
        return f"{STICKS} once in {self.periods} periods"

    def with_signature(self, signature: str) -> AbstractProblem:
        if signature.startswith("impacts"):
            # a branch continued beyond the interruption
            orbits = ImpactingOrbits(self.parameters, (), self.periods, 2)
            return orbits.with_signature(signature)
        return super().with_signature(signature)


def _stroboscopic(system, turn: ChatterOrbit, periods: int) -> Float[Array, "m n"]:
    """Return the states at the first multiples of the forcing period after release."""
    period = system.period
    first = jnp.ceil(turn.frame.release / period)

    def hop(carry):
        _, (time, state, speed), _, count = carry
        point = next_impact(system, time, state, speed, 2 * period)
        after = (point.time, point.state, point.speed)
        return (time, state), after, point.found, count + 1

    # complete chatter never ends the loop by itself, but here `end` precedes the
    # accumulation time, unless the latter is NaN
    begin = (turn.frame.release, turn.frame.state)
    start = (begin, (*begin, jnp.zeros(())), jnp.asarray(True), 0)

    def at(end):
        sticks = end >= turn.accumulation

        def goes_on(carry):
            _, (time, _, _), found, count = carry
            return ~sticks & found & (time < end) & (count < _IMPACTS)

        (time, state), *_ = jax.lax.while_loop(goes_on, hop, start)
        flown = flight_end(system, time, state, end, steps=_STEPS)
        in_contact = contact_state(system, end[None], turn.frame.state)[0]
        return jnp.where(sticks, in_contact, flown)

    return jax.lax.map(at, (first + jnp.arange(periods, dtype=jnp.float64)) * period)


def on_release(
    system: HybridSystem, periods: int = 1, beyond: bool = False
) -> tuple[StickingOrbits, np.ndarray]:
    """Return the problem of the orbit that sticks once in this number of periods, and
    its unknowns.

    Raises:
        ValueError: Contact never ends, or never begins.
    """
    return StickingOrbits(system, periods, beyond), release_of(system)


add_kind(STICKS, StickingOrbits)
