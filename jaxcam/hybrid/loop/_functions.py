"""The functions of a system that one iteration of the loop evaluates, as scalars."""

import contextlib
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._switched import SwitchedSystem
from .._system import HybridSystem
from ..lowering import (
    joined,
    Memory,
    motion_series,
    scalarise,
    split,
)
from ..runge_kutta import rates_among
from ..surface import (
    beyond_shares,
    completion_coefficients,
    field_and_distances,
    field_and_distances_in_mode,
    field_in_force,
    field_in_mode,
    gap_rounding,
    gaps,
    has_friction,
    heights_rounded,
    impacts,
    impacts_together,
    joint_rest,
    Jumps,
    least_compliance,
    may_hit_together,
    normal_velocity,
    open_surfaces,
    resets,
    settled,
    slack_of_hold,
    speed_rounding,
    surfaces,
    switched_rounding,
)
from ._derived import (
    free_taylor,
    in_mode,
    negative_sides,
    nested_series,
    planar_jet,
)
from ._frame import Frame, frame_of, lift_of
from ._gap_polynomial import Jet
from ._jumps import jumping_components


# highest derivatives that a step uses, of each part of `Distances`
_ORDERS = (3, 1, 3, 0)


class Functions:
    """Functions of `(t, x)` with `x` a tuple of scalars and the parameters bound.

    The discrete `mode` is a tuple of flags: whether each of the `m` constraints is in
    contact, then whether the motion is, or came from, on the negative side of each of
    the `k` switching surfaces, then whether it slides on each. Without surfaces, most
    functions do not depend on it.

    `planar` systems have two states, one constraint and no surface: gap and normal
    velocity determine the state during contact, which then needs no integration.
    `plain` functions are called unchanged, with arrays.
    """

    def __init__(self, system: HybridSystem, n: int, plain: bool = False):
        parameters, static = eqx.partition(system, eqx.is_inexact_array)
        time = jax.ShapeDtypeStruct((), jnp.float64)
        state = jax.ShapeDtypeStruct((n,), jnp.float64)
        m = jax.eval_shape(lambda t, x: gaps(system, t, x), time, state).shape[0]
        k = jax.eval_shape(lambda t, x: surfaces(system, t, x), time, state).shape[0]
        flags = jax.ShapeDtypeStruct((m,), jnp.bool_)
        mode = jax.ShapeDtypeStruct((m + 2 * k,), jnp.bool_)
        shapes = jax.tree.map(
            lambda p: jax.ShapeDtypeStruct(p.shape, p.dtype), parameters
        )
        self.n, self.m, self.k = n, m, k
        self.plain = plain
        self.planar = n == 2 and m == 1 and k == 0
        jumps = Jumps()
        if isinstance(system, SwitchedSystem):
            jumps = jumping_components(system, shapes, time, state, k)
        # surfaces on which a motion can slide
        self.slidable = [number for number, changed in enumerate(jumps.held) if changed]
        # whether contacts have friction; whether impacts may coincide
        self.rubs = m > 0 and has_friction(system)
        self.joins = may_hit_together(system, n, m)
        self._parameters = jax.tree.map(split, parameters)
        self._memory: Memory | None = None

        def bind(function, *example, whole_field=k == 0, series=False):
            if not whole_field:
                function, example = in_mode(function, m, jumps), (*example, mode)

            def whole(p, *arguments):
                return function(eqx.combine(p, static), *arguments)

            if plain:
                bound = functools.partial(whole, parameters)
                nested = functools.partial(nested_series, bound)
                return joined(nested if series else bound)
            if series:
                scalar = motion_series(whole, _ORDERS, shapes, *example)
            else:
                scalar = scalarise(whole, shapes, *example)
            return lambda *a: scalar(self._parameters, *a, memory=self._memory)

        if self.planar:
            self._field = bind(
                lambda s, t, x, c: s.vector_field(t, x), time, state, flags
            )
            self._jets = bind(planar_jet, time, state, flags)
            self._taylor = bind(free_taylor, time, state, flags)
        else:
            # the mode of a switched system contains the contacts
            held = () if k else (flags,)
            field = field_in_mode if k else field_in_force
            self._field = bind(field, time, state, *held)
            both = field_and_distances_in_mode if k else field_and_distances
            self._series = bind(both, time, state, *held, series=True)
        self._free = bind(lambda s, t, x: s.vector_field(t, x), time, state)
        blur = switched_rounding if k else gap_rounding
        self._blur = bind(blur, time, state, state)
        if k:
            self._resets = bind(resets, time, state)
            self._sides = bind(negative_sides, time, state, whole_field=True)
            self._open = bind(open_surfaces, time, state)
        if self.slidable:
            self._settled = bind(settled, time, state)
            self._shares = bind(beyond_shares, time, state)
            self._heights = bind(heights_rounded, time, state, state)
            self._slack = bind(slack_of_hold)
        if not m:
            return
        self._impact = bind(impacts, time, state)
        self._velocity = bind(normal_velocity, time, state)
        self._frame = bind(frame_of, time, state)
        self._lift = bind(lift_of, time, state)
        self._speed_blur = bind(speed_rounding, time, state, state)
        self._chatter = bind(completion_coefficients, time, state, state)
        if self.rubs:
            self._compliance = bind(least_compliance, time, state)
        if self.joins:
            self._together = bind(impacts_together, time, state, flags)
        if m > 1:
            self._joint_rest = bind(joint_rest, time, state, flags)

    @contextlib.contextmanager
    def sharing(self):
        """Compute equal expressions of the same scalars only once within this block.

        All calls in the block must belong to one trace (no loop or branch inside).
        """
        self._memory = Memory()
        try:
            yield
        finally:
            self._memory = None

    def _side(self, mode) -> tuple:
        """Return a mode as arguments: none without surfaces."""
        return (_pack(mode),) if self.k else ()

    def _held(self, mode) -> tuple:
        """Return the mode, or only the contacts without surfaces, as an argument."""
        return (_pack(mode if self.k else mode[: self.m]),)

    def field(self, t, x, mode):
        """Return the rate of change of the state in flight or, unless the system is
        planar, in contact.
        """
        return tuple(self._field(t, _pack(x), *self._held(mode)))

    def pairs(self, t, x, mode) -> dict[int, int]:
        """Return which components of the state are rates of others: see
        `rates_among`.
        """
        return rates_among(x, tuple(self._free(t, _pack(x), *self._side(mode))))

    def jets(self, t, x, mode) -> list[Jet]:
        """Return one jet for each constraint, then one for each surface.

        For a constraint in contact, acceleration and jerk are the multiplier q and its
        rate: q is zero at the release.
        """
        if self.planar:
            rows = self._jets(t, _pack(x), *self._held(mode))
            return [Jet(*rows[0])]
        along = self._series(t, _pack(x), *self._held(mode)).along
        found = []
        for k in range(self.m):
            gap, velocity, acceleration, jerk = (part.gaps[k] for part in along)
            q, rate = along[0].multipliers[k], along[1].multipliers[k]
            acceleration = jnp.where(mode[k], q, acceleration)
            found.append(
                Jet(gap, velocity, acceleration, jnp.where(mode[k], rate, jerk))
            )
        for k in range(self.k):
            value, *rates = (part.surfaces[k] for part in along)
            # the rates at a surface where a contact holds the motion are rounding
            still = along[0].still[k]
            found.append(Jet(value, *(jnp.where(still, 0.0, rate) for rate in rates)))
        return found

    def taylor(self, t, x, mode):
        """Return the first, second and third time derivatives of the state as three
        tuples.
        """
        if self.planar:
            rows = self._taylor(t, _pack(x), *self._held(mode))
        else:
            rows = self._series(t, _pack(x), *self._held(mode)).rates
        return tuple(tuple(row) for row in rows)

    def open_surfaces(self, t, x, mode) -> tuple[list[Jet], tuple]:
        """Return the jets of the surfaces, and the rounding errors of their distances,
        without contacts and sliding.
        """
        rows, rounding = self._open(t, _pack(x), *self._side(mode))
        return [Jet(*row) for row in rows], tuple(rounding)

    def impact(self, t, x, mode):
        """Return the state after an impact at each constraint, then after the crossing
        of each surface.
        """
        side = self._side(mode)
        rows = []
        if self.m:
            rows = [tuple(row) for row in self._impact(t, _pack(x), *side)]
        if self.k:
            rows += [tuple(row) for row in self._resets(t, _pack(x), *side)]
        return rows

    def impacts_together(self, t, x, closed, mode) -> tuple:
        """Return the state after the impacts at the `closed` constraints."""
        return tuple(self._together(t, _pack(x), _pack(closed), *self._side(mode)))

    def sides(self, t, x) -> tuple:
        """Return for each surface whether a start is on its negative side."""
        return tuple(self._sides(t, _pack(x))) if self.k else ()

    def settled(self, t, x, mode):
        """Return the state moved onto the surfaces on which it slides; and, for each
        surface that slides, the change of the field beyond it.
        """
        if not self.slidable:
            return x, []
        rows = self._settled(t, _pack(x), *self._side(mode))
        return tuple(rows[0]), [tuple(row) for row in rows[1:]]

    def shares(self, t, x, mode) -> tuple:
        """Return the weights of the branches beyond the surfaces on which it slides."""
        return tuple(self._shares(t, _pack(x), *self._side(mode)))

    def heights(self, t, x, extents, mode):
        """Return the switching functions, and their rounding errors."""
        reach = [jnp.abs(a) + b for a, b in zip(x, extents, strict=True)]
        rows = self._heights(t, _pack(x), _pack(reach), *self._side(mode))
        return tuple(rows[0]), tuple(rows[1])

    def slack(self, mode) -> tuple:
        """Return s = (holding - 1) / 2 of each surface."""
        return tuple(self._slack(*self._side(mode)))

    def velocity(self, t, x, mode):
        """Return the normal velocities."""
        if not self.m:
            return ()
        return tuple(self._velocity(t, _pack(x), *self._side(mode)))

    def frame(self, t, x, mode) -> Frame:
        """Return the `Frame` at this state."""
        if not self.m:
            return Frame((), (), (), ())
        parts = self._frame(t, _pack(x), *self._side(mode))
        lift, push, lift_velocity, damping = parts
        return Frame(
            tuple(map(tuple, lift)),
            tuple(map(tuple, push)),
            tuple(lift_velocity),
            tuple(damping),
        )

    def lift(self, t, x, mode):
        """Return, by gap, the displacement of the state that increases it by one."""
        if not self.m:
            return ()
        return tuple(map(tuple, self._lift(t, _pack(x), *self._side(mode))))

    def blur(self, t, x, extents, mode):
        """Return the rounding errors of the gaps, then of the distances of surfaces,
        for components up to `|x| + extents`.
        """
        reach = [jnp.abs(a) + b for a, b in zip(x, extents, strict=True)]
        return tuple(self._blur(t, _pack(x), _pack(reach), *self._side(mode)))

    def speed_blur(self, t, x, mode):
        """Return the rounding error of the normal velocities."""
        if not self.m:
            return ()
        reach = [jnp.abs(a) for a in x]
        side = self._side(mode)
        return tuple(self._speed_blur(t, _pack(x), _pack(reach), *side))

    def chatter(self, t, before, after, mode):
        """Return C, r0 and the state P of `surface/_chatter.py` for each constraint."""
        side = self._side(mode)
        parts = self._chatter(t, _pack(before), _pack(after), *side)
        damping, restitution, rest = parts
        return tuple(damping), tuple(restitution), tuple(map(tuple, rest))

    def joint_rest(self, t, x, touching, mode) -> tuple[tuple, tuple]:
        """Return the state at rest on the `touching` constraints, and all multipliers.

        Only for several constraints.
        """
        flags = _pack(touching)
        state, found = self._joint_rest(t, _pack(x), flags, *self._side(mode))
        return tuple(state), tuple(found)

    def compliance(self, t, x, mode):
        """Return the `least_compliance` of the contacts, only for contact friction."""
        return self._compliance(t, _pack(x), *self._side(mode))[()]

    def onto(self, frame: Frame, jets, x, mode):
        """Take one Newton step of the state towards gap = normal velocity = 0."""
        for k in range(self.m):
            gap, velocity = jets[k].gap, jets[k].velocity
            slip = velocity - gap * frame.lift_velocity[k]
            x = tuple(
                jnp.where(
                    mode[k],
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
