"""Obtain the unknowns of the shooting equations from a known motion."""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxcam.hybrid import HybridSystem, Trajectory
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.record import Impacts

from ._flight import flight_nodes
from ._shooting import Shooting
from ._turn_derivative import flown


if TYPE_CHECKING:
    from ._orbit import Orbit


_STEPS = (16, 32, 64, 128, 256)
"""Available numbers of steps."""
_ALLOWED = 1e-12
"""Allowed error of a flight."""


def steps_for(system: HybridSystem, starts, ends) -> int:
    """Return the number of steps per flight needed for an error of about 1e-12.

    **Arguments:** times and states `(m, 1 + n)` at the starts, times `(m,)` of the
    ends.

    Raises:
        ValueError: 256 steps are not enough.
    """
    starts, ends = jnp.asarray(starts), jnp.asarray(ends)
    for steps in _STEPS:
        wrong = float(np.max(np.asarray(_errors(system, starts, ends, steps))))
        if wrong < _ALLOWED:
            return steps
    if not wrong < 1e-9:
        raise ValueError(
            f"with {_STEPS[-1]} eighth-order steps, the error of a flight is "
            f"{wrong:.0e}; use a system whose vector field is smooth and not stiff"
        )
    return _STEPS[-1]


@program
def _errors(system, starts, ends, steps: int):
    return jax.vmap(lambda a, b: flight_nodes(system, a[0], a[1:], b, steps)[2])(
        starts, ends
    )


def seed(
    system: HybridSystem, motion: "Trajectory | Orbit", periods: int
) -> tuple[Shooting, Float[np.ndarray, " u"]]:
    """Return the shooting equations and unknowns for one period of a motion.

    Args:
        system: The system.
        motion: An orbit, or a run over one period near it.
        periods: Number of forcing periods in the motion; 0 without forcing.

    Returns:
        The equations, and the unknowns, shape `(u,)`.

    Raises:
        ValueError: The motion sticks, or has no impact and no forcing.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational.orbits import seed
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> equations, unknowns = seed(system, orbit, periods=1)
        >>> unknowns.round(4).tolist()  # time, position and velocity after the impact
        [0.0322, -0.5, -0.6586]
        >>> residual = equations.residual(jnp.asarray(unknowns), system)
        >>> float(jnp.max(jnp.abs(residual))) < 1e-9
        True
    """
    if int(motion.contacts.count):
        raise ValueError(
            "this motion sticks; follow it with StickingOrbits instead of "
            "ImpactingOrbits"
        )
    if isinstance(motion, Trajectory):
        t0, length = float(motion.t0), float(motion.t1) - float(motion.t0)
        dimension = int(motion.steps.state.shape[1])
    else:
        t0, length = float(motion.time), float(motion.period)
        dimension = int(motion.state.shape[0])
    if int(motion.impacts.count):
        return _of_impacts(system, motion.impacts, length, periods, dimension)
    if periods == 0:
        raise ValueError(
            "an orbit without forcing must have an impact to be continued as "
            "ImpactingOrbits; follow it as a LimitCycle"
        )
    # start from the state at a whole number of periods
    whole = -np.floor(-(t0 / length - 1e-12)) * length
    if isinstance(motion, Trajectory):
        state = np.asarray(motion.at([min(max(whole, t0), t0 + length)])[0])
        steps = _steps_of_turn(system, 0.0, state, length)
    else:
        steps = _steps_of_turn(system, t0, motion.state, length)
        begin, end = jnp.asarray(t0), jnp.asarray(whole)
        state = np.asarray(flown(system, begin, jnp.asarray(motion.state), end))
    return Shooting((), periods, dimension, steps), state


def _steps_of_turn(system, t0, state, length) -> int:
    row = np.append(t0, np.asarray(state))
    return steps_for(system, row[None], np.array([t0 + length]))


def _of_impacts(system, impacts: Impacts, length, periods: int, dimension: int):
    m = int(impacts.count)
    times = np.asarray(impacts.time)[:m]
    hits = tuple(int(c) for c in np.asarray(impacts.constraint)[:m])
    rows = np.concatenate([times[:, None], np.asarray(impacts.after)[:m]], axis=1)
    steps = steps_for(system, rows, np.append(times[1:], times[0] + length))
    if periods:
        rows[:, 0] *= periods / length
        rows[:, 0] -= np.floor(rows[0, 0] / periods) * periods
    else:
        rows[:, 0] = (times - times[0]) / length
        rows[0, 0] = length
    return Shooting(hits, periods, dimension, steps), rows.ravel()
