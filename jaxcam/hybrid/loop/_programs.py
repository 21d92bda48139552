"""Trace the functions of a system as programs of scalars, once for all parameters."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._switched import SwitchedSystem
from ..caches import Cache
from ..lowering import joined, motion_series, scalarise
from ..sections import WithSection
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
    hold_of,
    impacts,
    impacts_together,
    joint_rest,
    Jumps,
    least_compliance,
    may_hit_together,
    normal_velocity,
    open_surfaces,
    pressed_accelerations,
    resets,
    settled,
    slack_of_hold,
    solve_masked,
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
from ._frame import frame_of, lift_and_remainder
from ._jumps import jumping_components


# for each part of `Distances`, the highest derivative that a step uses
_ORDERS = (3, 1, 3, 0)
# largest number of kinds of systems whose programs are kept
_MOST = 128


class Programs:
    """The programs of one kind of system, and properties derived from its structure.

    The programs are called with the parameters, split into scalars unless `plain`, and
    the arguments.
    """

    def __init__(self, static, shapes, n: int, plain: bool):
        time = jax.ShapeDtypeStruct((), jnp.float64)
        state = jax.ShapeDtypeStruct((n,), jnp.float64)

        def number(function) -> int:
            made = jax.eval_shape(
                lambda p, t, x: function(eqx.combine(p, static), t, x),
                shapes,
                time,
                state,
            )
            return made.shape[0]

        self._static, self._shapes, self._plain = static, shapes, plain
        self.m, self.k = m, k = number(gaps), number(surfaces)
        self.planar = n == 2 and m == 1 and k == 0
        self._jumps = Jumps()
        # the number of transitions between modes, which are the first surfaces; and for
        # each surface, those whose sides change at its crossing
        self.one_way, self.changed = 0, ()
        if isinstance(static, SwitchedSystem):
            self._jumps = jumping_components(static, shapes, time, state, k)
            self.one_way, self.changed = static.one_way, static.sides_changed(k)
        self.slidable = [i for i, changed in enumerate(self._jumps.held) if changed]
        self.rubs = m > 0 and has_friction(static)
        self.joins = may_hit_together(static, n, m)
        # the direction in which crossings of the last surface are counted, or None
        counts = isinstance(static, WithSection)
        self.counts = static.direction if counts else None
        self.by_name: dict[str, Callable] = {}
        flags = jax.ShapeDtypeStruct((m,), jnp.bool_)
        self._flight(time, state, flags)
        if k:
            self._at_surfaces(time, state)
        if m:
            self._at_constraints(time, state, flags)

    @property
    def portable(self) -> bool:
        """Whether the programs contain no values of the trace that made them."""
        made = self.by_name.values()
        return not self._plain and all(one.portable for one in made)  # pyright: ignore

    def _add(self, name: str, function, *example, by_mode=True, series=False) -> None:
        static, shapes = self._static, self._shapes
        if self.k and by_mode:
            mode = jax.ShapeDtypeStruct((self.m + 2 * self.k,), jnp.bool_)
            function, example = (
                in_mode(function, self.m, self._jumps),
                (*example, mode),
            )

        def whole(p, *arguments):
            return function(eqx.combine(p, static), *arguments)

        if self._plain:
            made = functools.partial(_unchanged, whole, series)
        elif series:
            made = motion_series(whole, _ORDERS, shapes, *example)
        else:
            made = scalarise(whole, shapes, *example)
        self.by_name[name] = made

    def _flight(self, time, state, flags) -> None:
        if self.planar:
            self._add("field", _free_field, time, state, flags)
            self._add("jets", planar_jet, time, state, flags)
            self._add("taylor", free_taylor, time, state, flags)
        else:
            # the mode of a switched system contains the contacts
            held = () if self.k else (flags,)
            field = field_in_mode if self.k else field_in_force
            self._add("field", field, time, state, *held)
            both = field_and_distances_in_mode if self.k else field_and_distances
            self._add("series", both, time, state, *held, series=True)
        self._add("free", lambda s, t, x: s.vector_field(t, x), time, state)
        blur = switched_rounding if self.k else gap_rounding
        self._add("blur", blur, time, state, state)

    def _at_surfaces(self, time, state) -> None:
        self._add("resets", resets, time, state)
        self._add("sides", negative_sides, time, state, by_mode=False)
        self._add("open", open_surfaces, time, state)
        if self.slidable:
            self._add("settled", settled, time, state)
            self._add("shares", beyond_shares, time, state)
            self._add("hold", hold_of, time, state)
            self._add("heights", heights_rounded, time, state, state)
            self._add("slack", slack_of_hold)

    def _at_constraints(self, time, state, flags) -> None:
        self._add("impact", impacts, time, state)
        self._add("velocity", normal_velocity, time, state)
        self._add("frame", frame_of, time, state)
        self._add("lift", lift_and_remainder, time, state)
        self._add("speed_blur", speed_rounding, time, state, state)
        speeds = jax.ShapeDtypeStruct((self.m,), jnp.float64)
        ends = state, state, speeds, speeds
        self._add("chatter", completion_coefficients, time, *ends)
        if self.rubs:
            self._add("compliance", least_compliance, time, state)
        if self.joins:
            self._add("together", impacts_together, time, state, flags)
            self._add("pressed", pressed_accelerations, time, state, flags)
        if self.m > 1:
            self._add("joint_rest", joint_rest, time, state, flags)
            square = jax.ShapeDtypeStruct((self.m, self.m), jnp.float64)
            self._add("weights", _weights, square, speeds, flags, by_mode=False)


def _free_field(system, t, x, contact):
    del contact
    return system.vector_field(t, x)


def _weights(system, matrix, right, held):
    del system
    return solve_masked(matrix, right, held)


def _unchanged(whole, series: bool, parameters, *arguments, memory=None):
    del memory
    bound = functools.partial(whole, parameters)
    nested = functools.partial(nested_series, bound)
    return joined(nested if series else bound)(*arguments)


class _Kind(NamedTuple):
    """Everything on which the programs of a system depend."""

    # parts that are not parameters, with their types: 1, 1.0 and True compare equal
    leaves: tuple
    structure: Any
    shapes: tuple
    parameters: Any
    n: int


_KNOWN = Cache(_MOST)


def programs_of(static, parameters, n: int, *, plain: bool, shared: bool) -> Programs:
    """Return the programs of a system.

    **Arguments:** the system without its parameters; its parameters, of which only
    shapes and types matter; the number of its states; whether its functions are called
    unchanged; and whether the programs are traced once for all runs of such a system.
    """
    shapes = jax.tree.map(lambda p: jax.ShapeDtypeStruct(p.shape, p.dtype), parameters)

    def make() -> Programs:
        return Programs(static, shapes, n, plain)

    if plain or not shared:
        return make()
    leaves, structure = jax.tree.flatten(static)
    sizes, where = jax.tree.flatten(shapes)
    kind = _Kind(
        tuple((type(leaf), leaf) for leaf in leaves),
        structure,
        tuple((one.shape, np.dtype(one.dtype)) for one in sizes),
        where,
        n,
    )
    try:
        return _KNOWN.get(kind, make, lambda made: made.portable)
    except TypeError:
        # a part of the system, for example an array of integers, is not hashable
        return make()
