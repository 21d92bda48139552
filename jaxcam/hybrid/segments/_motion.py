"""Compile the functions used by the engine of `_pieces.py`."""

import functools

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._system import HybridSystem
from ..loop import first_extents, Jet, lift_and_remainder
from ..programs import program
from ..surface import (
    completion_time,
    contact_multipliers,
    field_in_force,
    forced_time,
    gap_rounding,
    gaps,
    impacts,
    impacts_together,
    joint_rest,
    least_gaps,
    lie_derivative,
    lie_series,
    normal_acceleration,
    normal_directions,
    normal_velocity,
    restitution_coefficients,
    speed_rounding,
    start_room,
)
from ._one_step import one_step, scaled_term
from ._points import ChatterEnd, Hop, PathPoint


# maximum number of attempted steps in one call of diffrax
_BATCH = 64
# points within each of these steps at which events are sought, as fractions of the step
FRACTIONS = np.arange(1, 9) / 8


def _compiled(method):
    """Compile a method only once: numbers are passed as arrays, whose values are not
    part of the program.
    """
    compiled = program(method)

    @functools.wraps(method)
    def call(self, *arguments):
        return compiled(self, *map(np.asarray, arguments))

    return call


class CompiledMotion(eqx.Module):
    """The compiled functions of time, state and the constraints in contact."""

    system: HybridSystem
    tolerance: jax.Array
    smallness: jax.Array
    scale: jax.Array
    """Scale of each component, `(n,)`, to which errors are relative."""
    solver: diffrax.AbstractSolver = eqx.field(static=True)

    def __init__(self, system, settings, scale):
        self.system = system
        self.scale = jnp.asarray(scale, dtype=jnp.float64)
        # arrays, so that another value does not trigger recompilation
        self.tolerance = jnp.asarray(settings.tolerance, dtype=jnp.float64)
        self.smallness = jnp.asarray(settings.chatter_smallness, dtype=jnp.float64)
        self.solver = settings.solver

    def measured(self, scale) -> "CompiledMotion":
        """Return the same functions with errors relative to another scale."""
        return eqx.tree_at(lambda m: m.scale, self, jnp.asarray(scale))

    @_compiled
    def fly(self, t0, x, contact, t1, first, longest):
        """Return the times and states of the steps up to an event, `t1` or the maximum
        number of attempts; the number of points; the number of attempts; and whether an
        event has occurred.
        """

        def lowest(t, y, args, **kwargs):
            del kwargs
            time, state = t0 + t, x + self.scale * y
            values = gaps(self.system, time, state)
            pressure = jax.lax.cond(
                jnp.any(args),
                lambda: -contact_multipliers(self.system, time, state, args),
                lambda: values,
            )
            return jnp.min(jnp.where(args, pressure, values))

        solution = diffrax.diffeqsolve(
            scaled_term(self._field, t0, x, self.scale),
            self.solver,
            jnp.zeros_like(t0),
            t1 - t0,
            jnp.minimum(first, t1 - t0),
            jnp.zeros_like(x),
            contact,
            saveat=diffrax.SaveAt(t0=True, steps=True),
            stepsize_controller=diffrax.PIDController(
                rtol=self.tolerance, atol=self.tolerance, dtmax=longest
            ),
            event=diffrax.Event(
                lowest,
                optx.Bisection(1e-12, 1e-12 * longest, flip=True),  # pyright: ignore
                direction=False,
            ),
            adjoint=diffrax.ForwardMode(),
            max_steps=_BATCH,
            throw=False,
        )
        assert solution.ts is not None and solution.ys is not None
        real = jnp.isfinite(solution.ts)
        # the last time is `t1` itself, without a rounding error
        times = jnp.where(solution.ts == t1 - t0, t1, t0 + solution.ts)
        states = jnp.where(
            real[:, None], x[None] + self.scale[None] * solution.ys, jnp.inf
        )
        fired = solution.event_mask
        return times, states, jnp.sum(real), solution.stats["num_steps"], fired

    @_compiled
    def probe(self, t, x, contact, h) -> PathPoint:
        """Return the point that is reached by one step of length `h` from `(t, x)`."""
        return self._point(t, x, contact, h)

    @_compiled
    def scan(self, times, states, contact, count) -> PathPoint:
        """Return points inside the first `count` steps, `(steps, fractions, m)`."""
        real = jnp.arange(times.shape[0] - 1) < count
        lengths = jnp.where(real, jnp.diff(times), 0.0)
        starts = jnp.where(real, times[:-1], times[0])
        origins = jnp.where(real[:, None], states[:-1], states[0])

        def inside(step):
            t, x, length = step
            return jax.lax.map(
                lambda f: self._point(t, x, contact, f * length),
                jnp.asarray(FRACTIONS),
            )

        # sequential, because a batch takes much longer to compile
        return jax.lax.map(inside, (starts, origins, lengths))

    @_compiled
    def hop(self, t, x, contact, h) -> Hop:
        """Return the end of a short flight, and the change in height from Gauss
        quadrature of the normal velocity.
        """
        nodes, weights = np.polynomial.legendre.leggauss(5)

        def velocity_at(s):
            after, _ = self._step(t, x, contact, s)
            return normal_velocity(self.system, t + s, after)

        lengths = h * jnp.asarray((nodes + 1) / 2)
        speeds = jax.vmap(velocity_at)(lengths)
        after, error = self._step(t, x, contact, h)
        level, rate = self._levels(t + h, after, contact)
        return Hop(
            after,
            level,
            rate,
            normal_velocity(self.system, t + h, after),
            h * jnp.sum(jnp.asarray(weights / 2)[:, None] * speeds, axis=0),
            jnp.max(jnp.abs(error) / (self.tolerance * self.scale)),
        )

    @_compiled
    def jets(self, t, x):
        """Return each gap and its first three derivatives in free flight, `(m, 4)`."""
        return jnp.stack(self._free_series(3)(t, x), axis=1)

    @_compiled
    def velocity(self, t, x):
        return normal_velocity(self.system, t, x)

    @_compiled
    def rounding(self, t, x, reach):
        """Return the rounding errors of gaps and normal velocities, `(2, m)`."""
        both = gap_rounding, speed_rounding
        return jnp.stack([one(self.system, t, x, reach) for one in both])

    @_compiled
    def start_room(self, t, x):
        """Return the gaps and normal velocities up to which a start counts as contact,
        `(2, m)`.
        """
        acceleration, time = normal_acceleration(self.system, t, x), self.system.period
        each = zip((gap_rounding, speed_rounding), (2, 1), strict=True)
        rounding = [(one(self.system, t, x, jnp.abs(x)), n) for one, n in each]
        return jnp.stack(
            [start_room(r, acceleration, forced_time(time) ** n) for r, n in rounding]
        )

    @_compiled
    def extents(self, t, x):
        """Return the origins and the initial scales of the components, each `(n,)`."""
        lifts, left = lift_and_remainder(self.system, t, x)
        jets = [Jet(*row) for row in jnp.stack(self._free_series(3)(t, x), axis=1)]
        tinies = least_gaps(self.system, t, x) - gaps(self.system, t, x)
        origin, found = first_extents(
            list(lifts), list(left), jets, list(tinies), tuple(x)
        )
        return jnp.stack(origin), jnp.stack(found)

    @_compiled
    def rates(self, t, x, contact):
        """Return the rates of the state, `(n,)`."""
        return self._field(t, x, contact)

    @_compiled
    def slopes(self, t, x, contact):
        """Return the magnitudes of the derivatives of the rates with respect to the
        state, `(n, n)`.
        """
        return jnp.abs(jax.jacfwd(lambda y: self._field(t, y, contact))(x))

    @_compiled
    def impact(self, t, x):
        return impacts(self.system, t, x)

    @_compiled
    def impacts_together(self, t, x, closed):
        """Return the state after the impacts at the `closed` constraints."""
        return impacts_together(self.system, t, x, closed)

    @_compiled
    def joint_rest(self, t, x, touching):
        """Return the state at rest on several constraints, and their multipliers."""
        return joint_rest(self.system, t, x, touching)

    @_compiled
    def completion(self, t, x, contact, k, speed, incoming) -> ChatterEnd:
        """Return the remaining chatter on constraint `k` after a rebound at `speed`.

        This is [`jaxcam.hybrid.surface.chatter_completion`][] for one of several
        constraints.
        """
        held = contact.at[k].set(True)

        def pressing(s, y):
            # normal acceleration in the motion that the other contacts allow
            return lie_derivative(
                lambda r, z: normal_velocity(self.system, r, z)[k],
                lambda r, z: self._field(r, z, contact),
            )(s, y)

        direction = normal_directions(self.system, t, x)[k]
        rest = x - speed * direction
        r0 = restitution_coefficients(self.system, t, rest)[k]
        softening = (speed / incoming - r0) / incoming
        a = pressing(t, rest)
        rate = lie_derivative(pressing, lambda s, y: self._field(s, y, held))(t, rest)
        damping = jax.jvp(lambda y: pressing(t, y), (rest,), (direction,))[1]
        jerk = lie_derivative(pressing, lambda s, y: self._field(s, y, contact))(t, x)
        acceleration = pressing(t, x)
        small = speed * jnp.abs(jerk) <= self.smallness * (1 - r0) * acceleration**2
        duration = completion_time(speed, a, rate, damping, r0, softening)
        possible = small & (r0 < 1) & (a < 0) & (a + rate * duration < 0)
        return ChatterEnd(
            possible, duration, self._point(t, rest, held, duration).state
        )

    def _field(self, t, x, contact):
        # free flight does not need the contact multipliers
        return jax.lax.cond(
            jnp.any(contact),
            lambda: field_in_force(self.system, t, x, contact),
            lambda: self.system.vector_field(t, x),
        )

    def _step(self, t, x, contact, h):
        return one_step(
            self.solver,
            self.tolerance,
            lambda s, y: self._field(s, y, contact),
            t,
            x,
            h,
            self.scale,
        )

    def _point(self, t, x, contact, h) -> PathPoint:
        after, _ = self._step(t, x, contact, h)
        after = jax.lax.cond(
            jnp.any(contact),
            lambda: self._onto(t + h, self._onto(t + h, after, contact), contact),
            lambda: after,
        )
        return PathPoint(after, *self._levels(t + h, after, contact))

    def _levels(self, t, x, contact):
        gap = self._free_series(1)(t, x)

        def pressed():
            pressure = lie_series(
                lambda s, y: -contact_multipliers(self.system, s, y, contact),
                lambda s, y: field_in_force(self.system, s, y, contact),
                1,
            )(t, x)
            return tuple(
                jnp.where(contact, p, g) for p, g in zip(pressure, gap, strict=True)
            )

        return jax.lax.cond(jnp.any(contact), pressed, lambda: gap)

    def _free_series(self, order):
        return lie_series(
            lambda s, y: gaps(self.system, s, y),
            lambda s, y: self.system.vector_field(s, y),
            order,
        )

    def _onto(self, t, x, contact):
        """Take one Newton step towards gap = normal velocity = 0 for constraints in
        contact.
        """

        def conditions(y):
            jet = jnp.stack(self._free_series(1)(t, y), axis=1)
            return jnp.where(contact[:, None], jet, 0.0).ravel()

        slope = jax.jacfwd(conditions)(x)
        return x - jnp.linalg.pinv(slope, rtol=1e-10) @ conditions(x)
