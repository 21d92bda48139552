"""One flight with the impact that ends it, its derivatives, and the map over a period.

All from one Jacobian of a flight, because flights are what takes long to compile: those
of the shooting equations, of the state from impact to impact, and of the map from the
first impact to the one a period later, also next to the orbit.
"""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid._normal import gaps, impacts

from ._shooting_flight import flight_nodes


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


# evaluations of Newton's method for a landing time that is known to a part in a hundred
_EVALUATIONS = 5


def landing(
    system: HybridSystem, start: Float[Array, " 1+n"], time, which, steps: int
) -> Float[Array, " 1+n"]:
    """Gap at `time` (s) after free flight from a row (time, state), and the state that
    an impact then leaves."""
    before = flight_nodes(system, start[0], start[1:], time, steps)[1][-1]
    gap = gaps(system, time, before)[which]
    return jnp.concatenate([gap[None], impacts(system, time, before)[which]])


def from_impact_to_impact(value, by_time, by_row):
    """Newton's correction of a landing, and the derivative of one impact by another.

    **Arguments:** gap and state `(1 + n,)` at a time near the landing, and their
    derivatives by that time `(1 + n,)` and by something else `(1 + n, k)`.

    **Returns:** the correction of the time, the state there, and the derivative of time
    and state `(1 + n, k)`.
    """
    correction = -value[0] / by_time[0]
    sooner = -by_row[0] / by_time[0]
    after = value[1:] + correction * by_time[1:]
    moved = by_row[1:] + jnp.outer(by_time[1:], sooner)
    return correction, after, jnp.concatenate([sooner[None], moved])


def equations_and_monodromy(problem: "ImpactingOrbits", u, p, parameters_at):
    """Derivative of the equations by unknowns and parameter, and the monodromy matrix.

    For forced systems; the parameters are `parameters_at(p)`.

    **Returns:** shapes `(u, u + 1)` and `(n, n)`.
    """
    m, n = len(problem.constraints), problem.dimension
    sizes = jnp.ones(1 + n)

    def one(row, later, which, wraps):
        def both(joined):
            parameters = parameters_at(joined[-1])
            base = parameters.period
            start = joined[: 1 + n] * sizes.at[0].set(base)
            time = (joined[1 + n] + wraps * problem.periods) * base
            value = landing(parameters, start, time, which, problem.steps)
            return value, value

        joined = jnp.concatenate([row, later[:1], jnp.reshape(p, (1,))])
        by, value = jax.jacfwd(both, has_aux=True)(joined)
        by_row, by_time, by_p = by[:, : 1 + n], by[:, 1 + n], by[:, 2 + n]
        moved = from_impact_to_impact(value, by_time, by_row[:, 1:])[2]
        # the deviation is taken at one time for all
        parameters = parameters_at(p)
        time = (later[0] + wraps * problem.periods) * parameters.period
        field = parameters.vector_field(time, value[1:]) * parameters.period
        factor = moved[1:] - jnp.outer(field, moved[0])
        # the equations are (gap, next state - state left by the impact)
        sign = -sizes.at[0].set(-1.0)
        by_later = jnp.diag(sizes.at[0].set(0.0)).at[:, 0].add(sign * by_time)
        return sign[:, None] * by_row, by_later, sign * by_p, factor

    rows = u.reshape(m, 1 + n)
    k = jnp.arange(m)
    by_row, by_later, by_p, factors = jax.vmap(one)(
        rows,
        jnp.roll(rows, -1, axis=0),
        problem.hit(),
        jnp.where(k == m - 1, 1.0, 0.0),
    )
    whole = jnp.zeros((m, m, 1 + n, 1 + n)).at[k, k].add(by_row)
    whole = whole.at[k, (k + 1) % m].add(by_later)
    whole = whole.transpose(0, 2, 1, 3).reshape(u.size, u.size)
    matrix = jnp.eye(n)
    for factor in factors:
        matrix = factor @ matrix
    return jnp.concatenate([whole, by_p.reshape(-1, 1)], axis=1), matrix


def around_the_period(problem: "ImpactingOrbits", u, parameters):
    """The Jacobian of the map from the first impact to the one a period later.

    Of (phase, state), without forcing of the state, without impacts of the state at
    time zero.

    **Returns:** the Jacobian as a function of a point near the orbit's own, and that.
    """
    steps = problem.steps
    if not problem.constraints:
        whole, start = problem.period(u, parameters), jnp.zeros(())

        def end(x):
            return flight_nodes(parameters, start, x, whole, steps)[1][-1]

        return jax.jacfwd(end), u

    starts, ends = problem.segments(u, parameters)

    def hop(carry, known):
        start, matrix = carry
        time, which = known

        def both(joined):
            value = landing(parameters, joined[:-1], joined[-1], which, steps)
            return value, value

        def improve(_, found):
            time = found[0]
            by, value = jax.jacfwd(both, has_aux=True)(jnp.append(start, time))
            change, after, moved = from_impact_to_impact(value, by[:, -1], by[:, :-1])
            return time + change, after, moved

        first = (time, start[1:], jnp.zeros((start.size, start.size)))
        time, after, moved = jax.lax.fori_loop(0, _EVALUATIONS, improve, first)
        return (jnp.append(time, after), moved @ matrix), None

    def whole_turn(start):
        begin = (start, jnp.eye(start.size))
        return jax.lax.scan(hop, begin, (ends[:, 0], problem.hit()))[0][1]

    if problem.periods == 0:
        return lambda x: whole_turn(jnp.append(starts[0, :1], x))[1:, 1:], starts[0, 1:]

    unit = problem.period(u, parameters) / problem.periods
    sizes = jnp.ones(starts.shape[1]).at[0].set(unit)

    def of_phase(y):
        return whole_turn(y * sizes) * (sizes[None, :] / sizes[:, None])

    return of_phase, u[: starts.shape[1]]
