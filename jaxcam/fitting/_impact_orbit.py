"""Periodic orbits given by their impacts: a few flights that close upon themselves.

An orbit with k impacts in a span of time S is k pairs (t_i, x_i), the time of an impact
and the state just after it, with

    H(t_i, x_i) = 0,    R(t_{i+1}, phi(t_{i+1}; t_i, x_i)) = x_{i+1},

and (t_k, x_k) = (t_0 + S, x_0). The number of impacts is given, so no events have to be
found: the equations are smooth in the parameters, which is what a fit needs.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from variational import saltation_matrix

from ..hybrid import HybridSystem, normal_velocity
from ..hybrid._runge_kutta import step, tableau_of
from ._implicit import implicit_root


_TABLEAU = tableau_of(diffrax.Dopri8())


class ImpactOrbit(eqx.Module):
    """A periodic orbit that flies between impacts, without sustained contact.

    **Arguments:**

    - `times`: shape `(k,)`, the impacts of one period of the orbit (s), increasing.
    - `states`: shape `(k, n)`, the state just after each of them.
    """

    times: Float[Array, " k"]
    states: Float[Array, "k n"]

    @property
    def number(self) -> int:
        """How many impacts the orbit has."""
        return self.times.shape[0]

    def to_vector(self) -> Float[Array, " unknowns"]:
        """All times, then all states."""
        return jnp.concatenate([self.times, self.states.ravel()])

    @staticmethod
    def from_vector(vector: Float[Array, " unknowns"], number: int) -> "ImpactOrbit":
        """The orbit with `number` impacts that `to_vector` was made of."""
        return ImpactOrbit(vector[:number], vector[number:].reshape(number, -1))


def fly(
    system: HybridSystem, t, state, duration, steps: int = 32
) -> Float[Array, " n"]:
    """The state after a free flight of `duration` (s) that starts at `t`.

    Dormand and Prince's method of order 8 with `steps` equal steps; impacts are not
    looked for.
    """
    return _stops(system, t, state, duration, steps)[-1]


def _stops(system, t, state, duration, steps):
    # the state after each step, (steps, n)
    h = duration / steps
    n = state.shape[0]

    def field(time, x):
        rate = system.vector_field(time, jnp.stack(x))
        return tuple(rate[i] for i in range(n))

    def one(x, k):
        after = step(_TABLEAU, field, t + k * h, x, h)[0]
        return after, jnp.stack(after)

    start = tuple(state[i] for i in range(n))
    return jax.lax.scan(one, start, jnp.arange(steps, dtype=h.dtype))[1]


def impact_orbit(
    system: HybridSystem,
    guess: ImpactOrbit,
    *,
    turns: int = 1,
    constraint: int = 0,
    steps: int = 32,
) -> ImpactOrbit:
    """The orbit near `guess`, differentiable with respect to every parameter.

    **Arguments:**

    - `turns`: periods of the forcing after which the orbit repeats.
    - `constraint`: the constraint that is hit, where there are several.
    - `steps`: Runge-Kutta steps of order 8 in each flight.

    **Returns:** an [`jaxcam.fitting.ImpactOrbit`][], NaN where there is none near the
    guess. That its flights stay clear of the constraint is not looked at; see
    [`jaxcam.fitting.clearance`][].
    """

    def residual(unknowns):
        orbit = ImpactOrbit.from_vector(unknowns, guess.number)
        return orbit_residual(
            system, orbit, turns=turns, constraint=constraint, steps=steps
        )

    root = implicit_root(residual, guess.to_vector())
    return ImpactOrbit.from_vector(root, guess.number)


def orbit_monodromy(
    system: HybridSystem,
    orbit: ImpactOrbit,
    *,
    turns: int = 1,
    constraint: int = 0,
    steps: int = 32,
) -> Float[Array, "n n"]:
    """How a deviation at a fixed phase grows over one period of the orbit.

    Product of flight transition matrices and saltation matrices, in the order of the
    motion, beginning just after the first impact.

    **Returns:** shape `(n, n)`. Its eigenvalues are the Floquet multipliers.
    """
    durations = durations_of(system, orbit, turns)

    def transition(t, state, duration):
        def end(x):
            arrived = fly(system, t, x, duration, steps)
            return arrived, arrived

        return jax.jacfwd(end, has_aux=True)(state)

    transitions, ends = jax.vmap(transition)(orbit.times, orbit.states, durations)
    matrix = jnp.eye(orbit.states.shape[1])
    for k in range(orbit.number):
        jump = saltation_matrix(
            system, orbit.times[k] + durations[k], ends[k], constraint
        )
        matrix = jump @ transitions[k] @ matrix
    return matrix


def orbit_trace(system, orbit, **options) -> Float[Array, ""]:
    """Sum of the Floquet multipliers."""
    return jnp.trace(orbit_monodromy(system, orbit, **options))


def orbit_determinant(system, orbit, **options) -> Float[Array, ""]:
    """Product of the Floquet multipliers."""
    return jnp.linalg.det(orbit_monodromy(system, orbit, **options))


def clearance(
    system: HybridSystem,
    orbit: ImpactOrbit,
    *,
    turns: int = 1,
    constraint: int = 0,
    steps: int = 32,
) -> Float[Array, ""]:
    """The smallest of the things that must be positive for the orbit to be real.

    They are the approach and rebound speeds of its impacts, the durations of its
    flights, and the gap at the end of each Runge-Kutta step inside a flight.
    """
    durations = durations_of(system, orbit, turns)

    def one(t, state, duration):
        stops = _stops(system, t, state, duration, steps)

        def gap(k, x):
            return jnp.atleast_1d(system.gap(t + k * duration / steps, x))[constraint]

        inside = jax.vmap(gap)(jnp.arange(1.0, steps), stops[:-1])
        rebound = normal_velocity(system, t, state)[constraint]
        approach = -normal_velocity(system, t + duration, stops[-1])[constraint]
        smallest = jnp.minimum(jnp.minimum(rebound, approach), duration)
        return jnp.minimum(smallest, jnp.min(inside))

    return jnp.min(jax.vmap(one)(orbit.times, orbit.states, durations))


def durations_of(system, orbit, turns):
    span = turns * system.period
    return jnp.append(orbit.times[1:], orbit.times[0] + span) - orbit.times


def orbit_residual(
    system: HybridSystem,
    orbit: ImpactOrbit,
    *,
    turns: int = 1,
    constraint: int = 0,
    steps: int = 32,
) -> Float[Array, " unknowns"]:
    """What is zero for a periodic orbit: k gaps, and k states that must meet."""
    durations = durations_of(system, orbit, turns)

    def closes(t, state, duration, following):
        end = fly(system, t, state, duration, steps)
        gap = jnp.atleast_1d(system.gap(t, state))[constraint]
        after = jnp.atleast_2d(system.impact(t + duration, end))[constraint]
        return jnp.append(after - following, gap)

    following = jnp.roll(orbit.states, -1, axis=0)
    values = jax.vmap(closes)(orbit.times, orbit.states, durations, following)
    return values.ravel()
