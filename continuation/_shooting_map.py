"""The map over a period next to an orbit that hits, as often differentiable as wanted.

Each impact follows from the one before by equations that are solved at the orbit. From
there the chord method, Newton's with the derivative at the orbit, gains one order of
the Taylor series with each iteration.
"""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid._normal import gaps, impacts

from ._shooting_flight import flight_nodes


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


# order up to which the derivatives of the map are right
_ORDER = 3


def map_of_period(problem: "ImpactingOrbits", u, parameters):
    """The map that takes the first impact to the one a period later, and its point.

    **Returns:** a function of (phase, state), without forcing of the state, without
    impacts of the state at time zero; and the orbit's own value of it.
    """
    steps = problem.steps

    def fly(start, end):
        return flight_nodes(parameters, start[0], start[1:], end, steps)[1][-1]

    if not problem.constraints:
        whole = problem.period(u, parameters)
        return lambda x: fly(jnp.append(jnp.zeros(1), x), whole), u

    starts, ends = problem.segments(u, parameters)
    length = problem.period(u, parameters)
    unit = length / max(problem.periods, 1)

    def defect(start, end, which):
        before = fly(start, end[0])
        gap = gaps(parameters, end[0], before)[which]
        after = impacts(parameters, end[0], before)[which]
        return jnp.concatenate([gap[None], end[1:] - after])

    chords = jax.vmap(
        lambda start, end, which: jnp.linalg.inv(
            jax.jacfwd(defect, argnums=1)(start, end, which)
        )
    )(starts, ends, problem.hit())

    def hop(start, known):
        end, which, chord = known

        def improve(_, z):
            return z - chord @ defect(start, z, which)

        return jax.lax.fori_loop(0, _ORDER, improve, end), None

    def after(start: Float[Array, " row"]) -> Float[Array, " row"]:
        return jax.lax.scan(hop, start, (ends, problem.hit(), chords))[0]

    if problem.periods == 0:
        return lambda x: after(jnp.append(starts[0, :1], x))[1:], starts[0, 1:]

    def of_phase(y):
        end = after(y.at[0].multiply(unit))
        return end.at[0].set((end[0] - length) / unit)

    return of_phase, u[: starts.shape[1]]
