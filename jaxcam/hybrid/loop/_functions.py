"""The functions of a system that one iteration of the loop evaluates, as scalars."""

import contextlib
import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._system import HybridSystem
from ..lowering import joined, scalarise, split
from ..runge_kutta import rates_among
from ..surface import (
    completion_coefficients,
    field_in_force,
    free_jet,
    gap_rounding,
    gaps,
    impacts,
    lie_series,
    mode_jet,
    normal_acceleration,
    normal_directions,
    normal_velocity,
    speed_rounding,
)
from ._gap_polynomial import Jet


class Frame(NamedTuple):
    """Directions used to move a state back onto the surface; see `Functions.onto`."""

    lift: tuple
    push: tuple
    lift_velocity: tuple
    damping: tuple


class Functions:
    """Functions of `(t, x)` with `x` a tuple of scalars and the parameters bound.

    `planar` systems have two states and one constraint: gap and normal velocity
    determine the state during contact, which then needs no integration. `plain`
    functions are called unchanged, with arrays.
    """

    def __init__(self, system: HybridSystem, n: int, plain: bool = False):
        parameters, static = eqx.partition(system, eqx.is_inexact_array)
        time = jax.ShapeDtypeStruct((), jnp.float64)
        state = jax.ShapeDtypeStruct((n,), jnp.float64)
        m = jax.eval_shape(lambda t, x: gaps(system, t, x), time, state).shape[0]
        flags = jax.ShapeDtypeStruct((m,), jnp.bool_)
        shapes = jax.tree.map(
            lambda p: jax.ShapeDtypeStruct(p.shape, p.dtype), parameters
        )
        self.n, self.m = n, m
        self.plain = plain
        self.planar = n == 2 and m == 1
        self._parameters = jax.tree.map(split, parameters)
        self._memory: dict | None = None

        def bind(function, *example):
            def whole(p, *arguments):
                return function(eqx.combine(p, static), *arguments)

            if plain:
                return joined(functools.partial(whole, parameters))
            scalar = scalarise(whole, shapes, *example)
            return lambda *a: scalar(self._parameters, *a, memory=self._memory)

        if self.planar:
            self._field = bind(
                lambda s, t, x, c: s.vector_field(t, x), time, state, flags
            )
            self._jets = bind(_planar_jet, time, state, flags)
            self._taylor = bind(_free_taylor, time, state, flags)
        else:
            self._field = bind(field_in_force, time, state, flags)
            self._jets = bind(mode_jet, time, state, flags)
            self._taylor = bind(_mode_taylor, time, state, flags)
        self._free = bind(lambda s, t, x: s.vector_field(t, x), time, state)
        self._impact = bind(impacts, time, state)
        self._velocity = bind(normal_velocity, time, state)
        self._frame = bind(_frame, time, state)
        self._lift = bind(_lift, time, state)
        self._blur = bind(gap_rounding, time, state, state)
        self._speed_blur = bind(speed_rounding, time, state, state)
        self._chatter = bind(completion_coefficients, time, state, state)

    @contextlib.contextmanager
    def sharing(self):
        """Compute equal expressions of the same scalars only once within this block.

        All calls in the block must belong to one trace (no loop or branch inside).
        """
        self._memory = {}
        try:
            yield
        finally:
            self._memory = None

    def field(self, t, x, contact):
        """Return the rate of change: flight, or (not planar) sticking in contact."""
        return tuple(self._field(t, _pack(x), _pack(contact)))

    def pairs(self, t, x) -> dict[int, int]:
        """Return which components of the state are rates of others: see
        `rates_among`.
        """
        return rates_among(x, tuple(self._free(t, _pack(x))))

    def jets(self, t, x, contact) -> list[Jet]:
        """Return one jet for each constraint."""
        rows = self._jets(t, _pack(x), _pack(contact))
        return [Jet(*rows[k]) for k in range(self.m)]

    def taylor(self, t, x, contact):
        """Return the first, second and third time derivatives of the state as three
        tuples.
        """
        rows = self._taylor(t, _pack(x), _pack(contact))
        return tuple(tuple(row) for row in rows)

    def impact(self, t, x):
        """Return the state after an impact at each constraint."""
        rows = self._impact(t, _pack(x))
        return [tuple(rows[k]) for k in range(self.m)]

    def velocity(self, t, x):
        """Return the normal velocities."""
        return tuple(self._velocity(t, _pack(x)))

    def frame(self, t, x) -> Frame:
        """Return the `Frame` at this state."""
        lift, push, lift_velocity, damping = self._frame(t, _pack(x))
        return Frame(
            tuple(map(tuple, lift)),
            tuple(map(tuple, push)),
            tuple(lift_velocity),
            tuple(damping),
        )

    def lift(self, t, x):
        """Return the directions in which the gaps grow by one."""
        return tuple(map(tuple, self._lift(t, _pack(x))))

    def blur(self, t, x, extents):
        """Return the rounding errors of the gaps, for components up to `extents`."""
        reach = [jnp.abs(a) + b for a, b in zip(x, extents, strict=True)]
        return tuple(self._blur(t, _pack(x), _pack(reach)))

    def speed_blur(self, t, x):
        """Return the rounding error of the normal velocities."""
        reach = [jnp.abs(a) for a in x]
        return tuple(self._speed_blur(t, _pack(x), _pack(reach)))

    def chatter(self, t, before, after):
        """Return C, r0 and the state P of `_chatter.py` for each constraint."""
        damping, restitution, rest = self._chatter(t, _pack(before), _pack(after))
        return tuple(damping), tuple(restitution), tuple(map(tuple, rest))

    def onto(self, frame: Frame, jets, x, contact):
        """Take one Newton step of the state towards gap = normal velocity = 0."""
        for k in range(self.m):
            gap, velocity = jets[k].gap, jets[k].velocity
            slip = velocity - gap * frame.lift_velocity[k]
            x = tuple(
                jnp.where(
                    contact[k],
                    x[i] - gap * frame.lift[k][i] - slip * frame.push[k][i],
                    x[i],
                )
                for i in range(self.n)
            )
        return x


def _pack(scalars) -> np.ndarray:
    out = np.empty(len(scalars), dtype=object)
    for i, s in enumerate(scalars):
        out[i] = s
    return out


def _planar_jet(system, t, x, contact):
    """Return the free jet; in contact, the rate of a along the sticking motion is j - C
    a.
    """
    jet = free_jet(system, t, x)
    direction = normal_directions(system, t, x)[0]
    _, damping = jax.jvp(
        lambda y: normal_acceleration(system, t, y)[0], (x,), (direction,)
    )
    along = jet[0, 3] - damping * jet[0, 2]
    jerk = jnp.where(contact[0], along, jet[0, 3])
    return jnp.stack([jet[0, 0], jet[0, 1], jet[0, 2], jerk])[None]


def _taylor_of(field, t, x):
    return jnp.stack(lie_series(field, field, 2)(t, x))


def _free_taylor(system, t, x, contact):
    del contact
    return _taylor_of(lambda s, y: system.vector_field(s, y), t, x)


def _mode_taylor(system, t, x, contact):
    return _taylor_of(lambda s, y: field_in_force(system, s, y, contact), t, x)


def _frame(system, t, x):
    """Return the directions E (unit gap) and D (unit velocity), v_x E, and C = a_x
    D.
    """
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    curve = jax.jacfwd(lambda y: normal_acceleration(system, t, y))(x)
    push = normal_directions(system, t, x)
    lift = _lift(system, t, x)
    return lift, push, jnp.sum(slope * lift, axis=1), jnp.sum(curve * push, axis=1)


def _lift(system, t, x):
    gradient = jax.jacfwd(lambda y: gaps(system, t, y))(x)
    return gradient / jnp.sum(gradient * gradient, axis=1)[:, None]
