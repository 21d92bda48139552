"""The local map of a grazing orbit: discontinuity mappings and the square-root map.

At a grazing point, the gap H has a minimum of zero: H = 0, its rate v is 0, and its
acceleration a is positive. A neighbouring motion whose gap would reach the depth
d = -min H > 0 hits the constraint with the speed sqrt(2 a d). With the coefficient of
restitution r, the impact changes the state by (1 + r) sqrt(2 a d) D, where D is the
direction of the impulse (v_x D = 1). All other effects are of higher order, so the flow
is that of the system without the constraint, after the map

    z -> z + b sqrt(d(z)),   b = (1 + r) sqrt(2 a) D,   d(z) = -(H_x z + H_mu mu).

This map is the zero-time discontinuity mapping of di Bernardo, Budd and Champneys
(Physica D 160, 2001); on the section v = 0, the vector is b - F v_x b / a. The
composition with the derivative N of one period is the local map
z -> N (z + b sqrt(d)) + N_mu mu.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxcam.hybrid import HybridSystem, simulate
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import (
    normal_acceleration,
    normal_directions,
    restitution_coefficients,
)
from jaxcam.parameters import as_arrays, pick, Where

from .orbits import (
    builder,
    by_product,
    eigenvalues,
    flight_end,
    lowest_times,
    Orbit,
    orbit_of,
    picked,
    steps_for,
)


class GrazingForm(eqx.Module):
    """The leading-order map in the neighbourhood of a grazing orbit.

    z, shape `(n,)`, is the deviation of the state at the time of grazing from the orbit
    of the unchanged system; mu, shape `(q,)`, is the change of the parameters. The map
    is that of M. di Bernardo, C. J. Budd, A. R. Champneys, Physica D 160, 2001.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import grazing_form, orbit_of
        >>> system = ImpactOscillator(omega=2.0, damping=0.0, wall=0.334)
        >>> form = grazing_form(system, orbit_of(system, [-1 / 3, 0.0]))
        >>> form.step(jnp.zeros(2)).shape
        (2,)
    """

    time: Float[Array, ""]
    """Time at which the gap of the orbit is smallest (s)."""
    state: Float[Array, " n"]
    """State at `time`, shape `(n,)`."""
    clearance: Float[Array, ""]
    """Gap at `time`: zero for a grazing orbit, positive before grazing."""
    acceleration: Float[Array, ""]
    """Acceleration of the gap at `time`, positive."""
    restitution: Float[Array, ""]
    """Coefficient of restitution at `time`."""
    normal: Float[Array, " n"]
    """Gradient H_x of the gap, shape `(n,)`."""
    normal_parameters: Float[Array, " q"]
    """Derivative H_mu of the gap with respect to the parameters, shape `(q,)`."""
    zero_time: Float[Array, " n"]
    """The vector b of the zero-time discontinuity mapping, z -> z + b sqrt(depth),
    shape `(n,)`.
    """
    section: Float[Array, " n"]
    """The corresponding vector of the discontinuity mapping of the section on which the
    normal velocity is zero, shape `(n,)`.
    """
    matrix: Float[Array, "n n"]
    """Derivative N of one period starting at `time`, without the impact, shape `(n,
    n)`.
    """
    matrix_parameters: Float[Array, "n q"]
    """Derivative N_mu of one period starting at `time` with respect to the parameters,
    shape `(n, q)`.
    """

    @property
    def multipliers(self) -> Complex[Array, " n"]:
        """Multipliers of the orbit without the impact, shape `(n,)`."""
        return eigenvalues(self.matrix)

    @property
    def coefficient(self) -> Float[Array, ""]:
        """The change H_x N b of the smallest gap one period later, per unit of the
        square root of the penetration depth.
        """
        return self.normal @ self.matrix @ self.zero_time

    def depth(self, z: Float[Array, " n"], mu=None) -> Float[Array, ""]:
        """Return the depth to which a motion with this deviation would penetrate
        without an impact.

        Args:
            z: Deviation of the state, shape `(n,)`.
            mu: Change of the parameters, shape `(q,)`; default: none.

        Returns:
            The depth; negative if there is no impact.

        Examples:
            >>> from jaxcam.models import ImpactOscillator
            >>> from variational import grazing_form, orbit_of
            >>> system = ImpactOscillator(omega=2.0, damping=0.0, wall=0.334)
            >>> form = grazing_form(system, orbit_of(system, [-1 / 3, 0.0]))
            >>> round(float(form.depth(jnp.zeros(2))), 6)  # 1/3 minus the wall
            -0.000667
        """
        shift = 0.0 if mu is None else self.normal_parameters @ mu
        return -(self.clearance + self.normal @ z + shift)

    def discontinuity(self, z: Float[Array, " n"], mu=None) -> Float[Array, " n"]:
        """Apply the zero-time discontinuity mapping.

        Args:
            z: Deviation of the state, shape `(n,)`.
            mu: Change of the parameters, shape `(q,)`; default: none.

        Returns:
            Deviation after the mapping, shape `(n,)`.
        """
        deep = self.depth(z, mu)
        hits = deep > 0
        root = jnp.sqrt(jnp.where(hits, deep, 1.0))
        return z + self.zero_time * jnp.where(hits, root, 0.0)

    def step(self, z: Float[Array, " n"], mu=None) -> Float[Array, " n"]:
        """Apply the local map: the impact, if any, and then one period of the flow.

        Args:
            z: Deviation of the state, shape `(n,)`.
            mu: Change of the parameters, shape `(q,)`; default: none.

        Returns:
            Deviation one period later, shape `(n,)`.
        """
        moved = self.matrix @ self.discontinuity(z, mu)
        return moved if mu is None else moved + self.matrix_parameters @ mu

    def penetration(self, mu=None) -> Float[Array, ""]:
        """Return the parameter mu of Nordmark's map, [`variational.nordmark_map`][].

        This is the depth of the orbit that would pass through the constraint, divided
        by the square of `coefficient`. It is defined only if `coefficient` is positive.

        Args:
            mu: Change of the parameters, shape `(q,)`; default: none.

        Returns:
            A scalar.
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
    where: Where | None = None,
    constraint: int = 0,
) -> GrazingForm:
    """Compute the square-root map of an orbit that grazes, or nearly grazes, a
    constraint.

    Args:
        system: The system.
        orbit: A periodic orbit whose gap has a smooth minimum near zero; it may have
            other impacts.
        where: Selects the parameters mu, one or a tuple; default: none.
        constraint: Index of the grazed constraint.

    Returns:
        A [`variational.GrazingForm`][].

    Raises:
        ValueError: The smallest gap is at an impact or in contact.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import grazing_form, orbit_of
        >>> system = ImpactOscillator(omega=2.0, damping=0.0, wall=0.334)
        >>> orbit = orbit_of(system, [-1 / 3, 0.0])
        >>> round(float(grazing_form(system, orbit).clearance), 6)
        0.000667
    """
    system = as_arrays(system)
    time, state = _lowest(system, orbit, constraint)
    where = None if where is None else pick(where, system)
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
    """Return the time and state at which the gap has its smallest smooth minimum."""
    t0, t1 = float(orbit.time), float(orbit.time + orbit.period)
    turn = simulate(system, orbit.state, t0, t1, tolerance=1e-12)
    pieces = orbit.pieces
    flies = (pieces.end > pieces.start) & ~np.any(pieces.contact, axis=1)
    begin, ends = pieces.start[flies], pieces.end[flies]
    starts = np.concatenate([begin[:, None], np.asarray(turn.at(begin))], axis=1)
    steps = steps_for(system, starts, ends)
    found = _minima(system, starts, ends, constraint, steps)
    times, heights, states = map(np.asarray, found)
    heights = np.where((times < ends) & (heights > 0), heights, np.inf)
    best = int(np.argmin(heights))
    if not np.isfinite(heights[best]):
        raise ValueError(
            "the gap of this orbit has no smooth minimum; give an orbit that grazes or "
            "nearly does"
        )
    return jnp.asarray(times[best]), jnp.asarray(states[best])


@program
def _minima(system, starts, ends, constraint, steps: int):
    def one(start, end):
        times, heights = lowest_times(system, start, end, steps)
        time = times[constraint]
        state = flight_end(system, start[0], start[1:], time, steps=steps)
        return time, heights[constraint], state

    return jax.vmap(one)(jnp.asarray(starts), jnp.asarray(ends))


@program
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
