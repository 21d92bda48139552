"""The functions of a system that one iteration of the loop evaluates, as scalars."""

import contextlib
import itertools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._system import HybridSystem
from ..lowering import Memory, split
from ..runge_kutta import rates_among
from ..surface import ONE_DIRECTION
from ._frame import Frame
from ._gap_polynomial import Jet
from ._programs import programs_of
from ._select import everywhere, select, where_needed


class Functions:
    """Functions of `(t, x)`, where `x` is a tuple of scalars; the parameters are bound.

    The discrete `mode` is a tuple of flags: whether each of the `m` constraints is in
    contact, then whether the motion is on the negative side of each of the `k`
    switching surfaces (or, if it slides, came from there), then whether it slides on
    each. Without surfaces, most functions do not depend on the mode.

    `planar` systems have two states, one constraint and no surface: gap and normal
    velocity determine the state during contact, which then needs no integration.
    `plain` functions are called unchanged, with arrays. `shared` programs are traced
    once for all runs of this kind of system. Only runs that are not traced may use
    them: each trace by a user must see what has changed since the last one.

    If the compiled program may have `branches`, parts that no batch element needs are
    skipped; otherwise, all parts are computed for all batch elements.
    """

    def __init__(
        self,
        system: HybridSystem,
        n: int,
        plain: bool = False,
        *,
        shared: bool = False,
        branches: bool = False,
    ):
        parameters, static = eqx.partition(system, eqx.is_inexact_array)
        found = programs_of(static, parameters, n, plain=plain, shared=shared)
        self._program = found.by_name
        self.system = system
        self.n, self.m, self.k = n, found.m, found.k
        self.plain, self.planar = plain, found.planar
        self._branches = branches
        # surfaces on which a motion can slide
        self.slidable = found.slidable
        # the number of transitions between modes, which are the first surfaces
        self.one_way = found.one_way
        self._changed = found.changed
        # whether contacts have friction; whether impacts may coincide
        self.rubs, self.joins = found.rubs, found.joins
        # direction in which crossings of a Poincaré section, the last surface, count
        self.counts: int | None = found.counts
        self._parameters = parameters if plain else jax.tree.map(split, parameters)
        self._memory: Memory | None = None

    def _call(self, name: str, *arguments):
        program = self._program[name]
        return program(self._parameters, *arguments, memory=self._memory)

    @contextlib.contextmanager
    def sharing(self):
        """Compute equal expressions of the same scalars only once within this block.

        All calls in the block must belong to one trace: no loop inside, and no branches
        other than those of `where`.
        """
        self._memory = Memory()
        try:
            yield
        finally:
            self._memory = None

    def where(self, condition, compute: Callable, otherwise) -> Any:
        """Return the result of `compute` where the condition holds, `otherwise`
        elsewhere.
        """
        if not self._branches:
            return everywhere(condition, compute, otherwise)
        # values of a branch do not exist outside it
        outside, self._memory = self._memory, Memory()
        try:
            return where_needed(condition, compute, otherwise)
        finally:
            self._memory = outside

    def _side(self, mode) -> tuple:
        """Return a tuple with the mode, empty if there are no surfaces."""
        return (_pack(mode),) if self.k else ()

    def _held(self, mode) -> tuple:
        """Return a tuple with the mode; without surfaces, it contains only contacts."""
        return (_pack(mode if self.k else mode[: self.m]),)

    def field(self, t, x, mode):
        """Return the rate of change of the state in flight or, unless the system is
        planar, in contact.
        """
        return tuple(self._call("field", t, _pack(x), *self._held(mode)))

    def pairs(self, t, x, mode) -> dict[int, int]:
        """Return which components of the state are rates of change of others: see
        `rates_among`.
        """
        return rates_among(x, tuple(self._call("free", t, _pack(x), *self._side(mode))))

    def jets(self, t, x, mode) -> list[Jet]:
        """Return one jet for each constraint, then one for each surface.

        For a constraint in contact, the multiplier q, which is zero at the release, and
        its rate take the place of the acceleration and the jerk.
        """
        if self.planar:
            rows = self._call("jets", t, _pack(x), *self._held(mode))
            return [Jet(*rows[0])]
        along = self._call("series", t, _pack(x), *self._held(mode)).along
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
            # if a contact holds the motion at the surface, the rates are only rounding
            still = along[0].still[k]
            found.append(Jet(value, *(jnp.where(still, 0.0, rate) for rate in rates)))
        return found

    def taylor(self, t, x, mode):
        """Return the first, second and third time derivatives of the state as three
        tuples.
        """
        if self.planar:
            rows = self._call("taylor", t, _pack(x), *self._held(mode))
        else:
            rows = self._call("series", t, _pack(x), *self._held(mode)).rates
        return tuple(tuple(row) for row in rows)

    def open_surfaces(self, t, x, mode) -> tuple[list[Jet], tuple]:
        """Return the jets of the surfaces, and the rounding errors of their distances,
        for a motion that does not slide along them.
        """
        rows, rounding = self._call("open", t, _pack(x), *self._side(mode))
        return [Jet(*row) for row in rows], tuple(rounding)

    def impact(self, t, x, mode):
        """Return the state after an impact at each constraint, then after the crossing
        of each surface.
        """
        side = self._side(mode)
        rows = []
        if self.m:
            rows = [tuple(row) for row in self._call("impact", t, _pack(x), *side)]
        if self.k:
            rows += [tuple(row) for row in self._call("resets", t, _pack(x), *side)]
        return rows

    def impacts_together(self, t, x, closed, mode) -> tuple:
        """Return the state after the impacts at the `closed` constraints."""
        return tuple(
            self._call("together", t, _pack(x), _pack(closed), *self._side(mode))
        )

    def pressed(self, t, x, touching, mode) -> tuple:
        """Return the `pressed_accelerations` of bodies at rest on the `touching`
        constraints.
        """
        return tuple(
            self._call("pressed", t, _pack(x), _pack(touching), *self._side(mode))
        )

    def sides(self, t, x) -> tuple:
        """Return for each surface whether a start is on its negative side."""
        return tuple(self._call("sides", t, _pack(x))) if self.k else ()

    def turned(self, negative, crossed) -> list:
        """Return the flags of the negative sides after the crossings of surfaces."""
        flags = list(negative)
        for k, now in enumerate(crossed):
            for other in self._changed[k]:
                flags[other] = flags[other] ^ now
        return flags

    def settled(self, t, x, mode):
        """Return the state moved onto the surfaces on which the motion slides; and, for
        each `slidable` surface, the change of the field from one side to the other,
        zero if the motion does not slide there.
        """
        if not self.slidable:
            return x, []
        rows = self._call("settled", t, _pack(x), *self._side(mode))
        return tuple(rows[0]), [tuple(row) for row in rows[1:]]

    def shares(self, t, x, mode) -> tuple:
        """Return the weight of the branch beyond each surface, zero if the motion does
        not slide on it.
        """
        return tuple(self._call("shares", t, _pack(x), *self._side(mode)))

    def hold(self, t, x, mode) -> tuple[tuple, tuple]:
        """Return how far the weight of the branch beyond each surface is outside its
        limits, and this weight; see `hold_of`.
        """
        off, shares = self._call("hold", t, _pack(x), *self._side(mode))
        return tuple(off), tuple(shares)

    def heights(self, t, x, extents, mode):
        """Return the switching functions, and their rounding errors."""
        reach = [jnp.abs(a) + b for a, b in zip(x, extents, strict=True)]
        rows = self._call("heights", t, _pack(x), _pack(reach), *self._side(mode))
        return tuple(rows[0]), tuple(rows[1])

    def slack(self, mode) -> tuple:
        """Return s = (holding - 1) / 2 of each surface; the weight of the branch beyond
        the surface ranges from -s to 1 + s.
        """
        return tuple(self._call("slack", *self._side(mode)))

    def velocity(self, t, x, mode):
        """Return the normal velocity of each constraint."""
        if not self.m:
            return ()
        return tuple(self._call("velocity", t, _pack(x), *self._side(mode)))

    def frame(self, t, x, mode) -> Frame:
        """Return the `Frame` at this state."""
        if not self.m:
            return Frame((), (), (), (), ())
        parts = self._call("frame", t, _pack(x), *self._side(mode))
        return Frame(*(tuple(map(tuple, part)) for part in parts))

    def lift(self, t, x, mode):
        """Return, for each gap, the displacement of the state that opens it by one, and
        what is left of the gap after the displacement that should close it.
        """
        if not self.m:
            return (), ()
        rows, left = self._call("lift", t, _pack(x), *self._side(mode))
        return tuple(map(tuple, rows)), tuple(left)

    def blur(self, t, x, extents, mode):
        """Return the rounding errors of the gaps, then of the distances from surfaces,
        for components as large as `|x| + extents`.
        """
        reach = [jnp.abs(a) + b for a, b in zip(x, extents, strict=True)]
        return tuple(self._call("blur", t, _pack(x), _pack(reach), *self._side(mode)))

    def speed_blur(self, t, x, mode):
        """Return the rounding error of each normal velocity."""
        if not self.m:
            return ()
        reach = [jnp.abs(a) for a in x]
        side = self._side(mode)
        return tuple(self._call("speed_blur", t, _pack(x), _pack(reach), *side))

    def chatter(self, t, states, speeds, mode):
        """Return C, r0 and the state P, defined in `surface/_chatter.py`, for each
        constraint, by the states and the normal velocities before and after an impact.
        """
        ends = map(_pack, (*states, *speeds))
        parts = self._call("chatter", t, *ends, *self._side(mode))
        damping, restitution, rest = parts
        return tuple(damping), tuple(restitution), tuple(map(tuple, rest))

    def joint_rest(self, t, x, touching, mode) -> tuple[tuple, tuple]:
        """Return the state at rest on the `touching` constraints, and all multipliers.

        This is available only with several constraints.
        """
        flags = _pack(touching)
        state, found = self._call("joint_rest", t, _pack(x), flags, *self._side(mode))
        return tuple(state), tuple(found)

    def compliance(self, t, x, mode):
        """Return the `least_compliance` of the contacts, which must have friction."""
        return self._call("compliance", t, _pack(x), *self._side(mode))[()]

    def onto(self, frame: Frame, jets, x, mode):
        """Take one Newton step of the state towards gaps and normal velocities of zero
        on all constraints in contact.
        """
        rows, held = range(self.m), mode[: self.m]
        lengths = tuple(jets[k].gap for k in rows)
        pushes = tuple(
            jets[k].velocity - lengths[k] * frame.hurried[k][k] for k in rows
        )
        if self.m > 1 and self.n > ONE_DIRECTION:
            number = sum(jnp.where(flag, 1.0, 0.0) for flag in held)
            lengths, pushes = self.where(
                number > 1, lambda: self._onto_all(frame, jets, held), (lengths, pushes)
            )
        for k in rows:
            lift, push = frame.lift[k], frame.push[k]
            moved = [
                x[i] - lengths[k] * lift[i] - pushes[k] * push[i] for i in range(self.n)
            ]
            x = select(held[k], moved, x)
        return x

    def _onto_all(self, frame: Frame, jets, held) -> tuple[tuple, tuple]:
        """Return the parts of the step along each direction of a `Frame`, for bodies in
        contact with several constraints.
        """
        gaps = [jets[k].gap for k in range(self.m)]
        lengths = self._weights(frame.raised, gaps, held)
        speeds = [
            jets[k].velocity - sum(a * b for a, b in zip(row, lengths, strict=True))
            for k, row in enumerate(frame.hurried)
        ]
        return lengths, self._weights(frame.pushed, speeds, held)

    def _weights(self, matrix, right, held) -> tuple:
        """Return the solution of a linear system for the constraints in contact, zero
        for the others.
        """
        square = np.empty((self.m, self.m), dtype=object)
        for i, k in itertools.product(range(self.m), repeat=2):
            square[i, k] = matrix[i][k]
        return tuple(self._call("weights", square, _pack(right), _pack(held)))


def _pack(scalars) -> np.ndarray:
    out = np.empty(len(scalars), dtype=object)
    for i, s in enumerate(scalars):
        out[i] = s
    return out
