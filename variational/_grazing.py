"""What a grazing orbit becomes: discontinuity mappings and the square-root map.

At a graze the gap has a minimum of zero: H = v = 0 and a > 0. A neighbour whose gap
would reach the depth d = -min H > 0 hits with the speed sqrt(2 a d), which the impact
changes by (1 + r) sqrt(2 a d) in the direction D of the impulse (v_x D = 1). All else
being of higher order, the flow is what it would be without the wall, after the map

    z -> z + b sqrt(d(z)),   b = (1 + r) sqrt(2 a) D,   d(z) = -(H_x z + H_mu mu).

It is the zero-time discontinuity mapping of di Bernardo, Budd and Champneys (Physica D
160, 2001); on the section v = 0 the vector is b - F v_x b / a. Composed with the
derivative N of one period it is the local map z -> N (z + b sqrt(d)) + N_mu mu.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxcam.hybrid import (
    HybridSystem,
    normal_acceleration,
    normal_directions,
    normal_velocity,
    restitution_coefficients,
    simulate,
)
from jaxcam.hybrid._system import with_array_parameters

from ._multipliers import eigenvalues
from ._orbit import Orbit, orbit_of
from ._turn_derivative import builder, by_product, picked


class GrazingForm(eqx.Module):
    """The leading-order map of a neighbourhood of a grazing orbit.

    Deviations z, shape `(n,)`, are those of the state at the time of the graze, from
    the orbit of the system as it is; mu, shape `(q,)`, is the change of the parameters.
    """

    #: s, and the state there: where the gap of the orbit is smallest
    time: Float[Array, ""]
    state: Float[Array, " n"]
    #: gap at that point: zero at the graze, positive short of it
    clearance: Float[Array, ""]
    #: acceleration of the gap there, positive, and coefficient of restitution
    acceleration: Float[Array, ""]
    restitution: Float[Array, ""]
    #: H_x and H_mu
    normal: Float[Array, " n"]
    normal_parameters: Float[Array, " q"]
    #: the vectors b of the zero-time mapping, and of the mapping of the section v = 0
    zero_time: Float[Array, " n"]
    section: Float[Array, " n"]
    #: N and N_mu: derivative of one period from `time` on, without the graze
    matrix: Float[Array, "n n"]
    matrix_parameters: Float[Array, "n q"]

    @property
    def multipliers(self) -> Complex[Array, " n"]:
        """Multipliers of the orbit as long as it does not touch."""
        return eigenvalues(self.matrix)

    @property
    def coefficient(self) -> Float[Array, ""]:
        """H_x N b: the gap at the next pass for a square root of one."""
        return self.normal @ self.matrix @ self.zero_time

    def depth(self, z: Float[Array, " n"], mu=None) -> Float[Array, ""]:
        """How deep the gap of a deviation would go; negative without an impact."""
        shift = 0.0 if mu is None else self.normal_parameters @ mu
        return -(self.clearance + self.normal @ z + shift)

    def discontinuity(self, z: Float[Array, " n"], mu=None) -> Float[Array, " n"]:
        """The zero-time discontinuity mapping."""
        deep = self.depth(z, mu)
        hits = deep > 0
        root = jnp.sqrt(jnp.where(hits, deep, 1.0))
        return z + self.zero_time * jnp.where(hits, root, 0.0)

    def step(self, z: Float[Array, " n"], mu=None) -> Float[Array, " n"]:
        """The local map: the impact, if any, and then one period of the flow."""
        moved = self.matrix @ self.discontinuity(z, mu)
        return moved if mu is None else moved + self.matrix_parameters @ mu

    def penetration(self, mu=None) -> Float[Array, ""]:
        """The parameter mu of Nordmark's map, [`variational.nordmark_map`][].

        Depth of the orbit that would pass through the wall, over the square of the
        coefficient. Only where the coefficient is positive.
        """
        n = self.normal.shape[0]
        fixed = jnp.zeros(n)
        if mu is not None:
            fixed = jnp.linalg.solve(
                jnp.eye(n) - self.matrix, self.matrix_parameters @ mu
            )
        return self.depth(fixed, mu) / self.coefficient**2


def grazing_form(
    system: HybridSystem,
    orbit: Orbit,
    where: Callable[[Any], Any] | None = None,
    constraint: int = 0,
) -> GrazingForm:
    """The square-root map of an orbit that grazes a constraint, or almost does.

    **Arguments:**

    - `orbit`: a periodic orbit whose gap has a smooth minimum near zero; it may have
        other impacts.
    - `where`: picks the parameters mu, one or a tuple; none without.
    - `constraint`: the one that is grazed.

    **Raises:** `ValueError` where the smallest gap is at an impact or in contact.
    """
    system = with_array_parameters(system)
    time, state = _lowest(system, orbit, constraint)
    values = picked(system, where)
    near = _local(system, values, where, time, state, constraint)
    at = orbit_of(system, state, orbit.period, time)
    made = by_product(system, values, where, at.state, at.pieces, at.sticks)
    return GrazingForm(
        time=time,
        state=state,
        matrix=made.state,
        matrix_parameters=made.parameters,
        **near,
    )


def _lowest(system, orbit: Orbit, constraint):
    """Time and state at which the gap has its smallest smooth minimum."""
    t0, t1 = float(orbit.time), float(orbit.time + orbit.period)
    turn = simulate(system, orbit.state, t0, t1, tolerance=1e-12)
    count = int(turn.steps.count)
    times = np.sort(np.append(np.linspace(t0, t1, 513), turn.steps.time[:count]))
    times = np.unique(times)
    states = turn.at(times)
    speeds = np.asarray(_speeds(system, jnp.asarray(times), states)[:, constraint])
    heights = np.asarray(turn.gap(times)).reshape(len(times), -1)[:, constraint]
    jumps = np.asarray(turn.impacts.time)
    # speed from below to above zero without an impact in between
    turns = np.flatnonzero((speeds[:-1] < 0) & (speeds[1:] >= 0))
    smooth = [
        k
        for k in turns
        if not np.any((jumps >= times[k]) & (jumps <= times[k + 1])) and heights[k] > 0
    ]
    if not smooth:
        raise ValueError(
            "the gap of this orbit has no smooth minimum; give an orbit that grazes, "
            "or one just short of it"
        )
    best = min(smooth, key=lambda k: min(heights[k], heights[k + 1]))
    low, high = times[best], times[best + 1]
    share = -speeds[best] / (speeds[best + 1] - speeds[best])
    start = low + share * (high - low)
    time, state = _minimum(
        system, jnp.asarray(start), turn.at(start[None])[0], constraint
    )
    return time, state


@eqx.filter_jit
def _speeds(system, times, states):
    system = system.prepared()
    return jax.vmap(lambda t, x: normal_velocity(system, t, x))(times, states)


@eqx.filter_jit
def _minimum(system, t, x, constraint):
    """Newton's method for v = 0 along the flow; the state goes along."""
    system = system.prepared()

    def newton(_, carry):
        s, y = carry
        speed = normal_velocity(system, s, y)[constraint]
        pulled = normal_acceleration(system, s, y)[constraint]
        h = -speed / pulled

        def field(tau, z):
            return system.vector_field(s + tau, z)

        one = field(0.0 * h, y)
        two = field(h / 2, y + h / 2 * one)
        three = field(h / 2, y + h / 2 * two)
        four = field(h, y + h * three)
        return s + h, y + h / 6 * (one + 2 * two + 2 * three + four)

    return jax.lax.fori_loop(0, 6, newton, (t, x))


@eqx.filter_jit
def _local(system, values, where, t, x, constraint):
    build = builder(system, where)
    system = build(values)

    def height(s, p, y):
        return jnp.atleast_1d(build(p).gap(s, y))[constraint]

    clearance = height(t, values, x)
    normal_parameters, normal = jax.grad(height, argnums=(1, 2))(t, values, x)
    pulled = normal_acceleration(system, t, x)[constraint]
    restitution = restitution_coefficients(system, t, x)[constraint]
    push = normal_directions(system, t, x)[constraint]
    size = (1 + restitution) * jnp.sqrt(2 * pulled)
    return {
        "clearance": clearance,
        "acceleration": pulled,
        "restitution": restitution,
        "normal": normal,
        "normal_parameters": normal_parameters,
        "zero_time": size * push,
        "section": size * (push - system.vector_field(t, x) / pulled),
    }
