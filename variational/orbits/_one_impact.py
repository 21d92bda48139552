"""Find orbits with one impact per period without simulation."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import contact_acceleration, contact_state, normal_directions

from ._impact_orbit import clearance, impact_orbit, ImpactOrbit, orbit_trace


_PHASES, _SPEEDS = 12, 8


def one_impact_orbits(system: HybridSystem, state) -> list[ImpactOrbit]:
    """Find the orbits with one impact per forcing period, stable or not.

    Newton's method starts from a grid of impacts: phases in one period, and rebound
    speeds around the speed at which a body under the mean contact acceleration returns
    after one period.

    Args:
        system: A system with a `period`, two states and one constraint.
        state: A state near the constraint, shape `(2,)`.

    Returns:
        The admissible orbits, with impacts in the first period, ordered by the sum of
            their multipliers, so that a saddle is last. The list may be empty.

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import orbit_trace
        >>> from variational.orbits import one_impact_orbits
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbits = one_impact_orbits(system, jnp.array([-0.5, 0.0]))
        >>> [round(float(orbit_trace(system, orbit)), 4) for orbit in orbits]
        [0.5822, 3.527]
        >>> round(1 + 0.8**2, 4)  # the trace at a fold, which saddles exceed
        1.64
    """
    if system.period is None:
        raise ValueError(
            "Orbits with one impact per period need a system with a `period`."
        )
    orbits, clear, traces = jax.device_get(_search(system, jnp.asarray(state)))
    found: list[ImpactOrbit] = []
    scale = float(np.max(np.abs(orbits.states[clear > 0]), initial=0.0))
    for k in np.argsort(np.where(clear > 0, traces, np.inf)):
        if not clear[k] > 0:
            break
        orbit = jax.tree.map(lambda leaf, k=k: jnp.asarray(leaf[k]), orbits)
        # the same orbit is found from many starts, to within rounding error
        near = [
            np.max(np.abs(np.asarray(orbit.states - other.states))) < 1e-8 * scale
            for other in found
        ]
        if not any(near):
            found.append(orbit)
    return found


@program
def _search(system, state):
    period = jnp.asarray(system.period)
    times = period * jnp.arange(_PHASES, dtype=float) / _PHASES
    pull = jnp.mean(jnp.abs(contact_acceleration(system, times, state)))
    speeds = pull * period / 2 * jnp.linspace(0.25, 2.0, _SPEEDS)

    def one(t, speed):
        contact = contact_state(system, t[None], state)[0]
        start = contact + speed * normal_directions(system, t, contact)[0]
        orbit = impact_orbit(system, ImpactOrbit(t[None], start[None]))
        orbit = ImpactOrbit(jnp.mod(orbit.times, period), orbit.states)
        return orbit, clearance(system, orbit), orbit_trace(system, orbit)

    grid = jnp.meshgrid(times, speeds, indexing="ij")
    return jax.vmap(one)(grid[0].ravel(), grid[1].ravel())
