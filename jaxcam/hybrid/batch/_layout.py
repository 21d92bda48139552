"""Store many batch elements as one matrix, and compile the loop that works on it.

Each chunk is one dispatch with few arrays. If a whole system and all leaves of a batch
element were passed instead, a dispatch would take four times as long, which is as long
as the computation of a chunk for 64 elements.
"""

import functools
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._system import HybridSystem
from ..backend import Rowwise
from ..dependence import dependent
from ..loop import attempts, first_state, Functions, LoopState, Plan, run_many
from ..lowering import one_kernel, Packed, without_library


# ratio of the number of starts computed at once to that of batch elements that run at
# once
_AT_ONCE = 16


class LaneLayout(NamedTuple):
    """The matrix row of each number of a batch element, and the type of the number."""

    rows: Any
    dtypes: tuple

    def unpacked(self, numbers):
        """Return the batch element that consists of these numbers."""
        leaves = [
            number.astype(dtype)
            for number, dtype in zip(numbers, self.dtypes, strict=True)
        ]
        return jax.tree.unflatten(jax.tree.structure(self.rows), leaves)

    def example(self):
        """Return the shapes of the scalars of a batch element."""
        kinds = [jax.ShapeDtypeStruct((), dtype) for dtype in self.dtypes]
        return jax.tree.unflatten(jax.tree.structure(self.rows), kinds)


def packed(lane):
    """Return all numbers of one or more batch elements as rows of 64-bit floats."""
    xp = np if isinstance(jax.tree.leaves(lane)[0], np.ndarray) else jnp
    return xp.stack([xp.asarray(leaf, xp.float64) for leaf in jax.tree.leaves(lane)])


def layout_of(lane) -> LaneLayout:
    leaves, structure = jax.tree.flatten(lane)
    rows = jax.tree.unflatten(structure, range(len(leaves)))
    return LaneLayout(rows, tuple(leaf.dtype for leaf in leaves))


class Lanes(NamedTuple):
    """The batch to run: a system, the parameters that differ between batch elements,
    and the starts.
    """

    system: HybridSystem
    where: Callable | None
    """The leaves selected by `where` take the `values`, `(elements,)` or
    `(elements, k)`; both may be `None`.
    """
    values: np.ndarray | None
    states: np.ndarray
    """Initial states, `(elements, n)`."""

    def some(self, which: slice) -> "Lanes":
        """Return the batch elements that a slice selects."""
        values = None if self.values is None else self.values[which]
        return self._replace(values=values, states=self.states[which])


class Horizon(NamedTuple):
    """The time span to run: `number` periods of length `period` (s), starting at `t0`
    (s).

    By default, the period is that of the system in each batch element.
    """

    t0: Any
    period: Any
    number: int


class LaneStart(NamedTuple):
    """Initial batch elements, one column each, and the arrays for running them."""

    slots: LaneLayout
    numbers: np.ndarray
    own: Any
    """Parts of the system and the plan that differ between batch elements."""
    shared: Any
    """Arrays of the system and the plan that all batch elements share."""
    static: Any


def start_lanes(
    lanes: Lanes,
    horizon: Horizon,
    settings,
    width: int,
    first_of: Rowwise | None = None,
) -> LaneStart:
    """Return the start of the batch elements, of which `width` will run at a time.

    If `first_of` is given, it computes the first states together with derivatives.
    """
    pieces, count = [], len(lanes.states)
    whole = jnp.asarray(float(horizon.number))
    # padded, so that two compiled programs suffice for any number of batch elements
    part_size = width if count <= 2 * width else _AT_ONCE * width
    for first in range(0, count, part_size):
        some = np.minimum(np.arange(first, first + part_size), count - 1)
        part = None if lanes.values is None else lanes.values[some]
        batched, shared = split_lanes(lanes.system, lanes.where, part)
        state = jnp.asarray(lanes.states[some])
        span = horizon.period, horizon.t0, whole
        derived = first_of is not None
        own, rest = _ready(batched, shared, *span, settings, derived)
        given = (jnp.asarray(horizon.t0, jnp.float64), rest), (own, state), len(state)
        if first_of is None:
            lane = _FIRST(*given, compiles=settings.compiles)
        else:
            lane = first_of.by_llvm(*given)
        pieces.append((lane, own))
    slots = layout_of(pieces[0][0])
    shared, static = eqx.partition(rest, eqx.is_array)
    numbers = np.concatenate([np.asarray(packed(lane)) for lane, _ in pieces], axis=1)
    each = [own for _, own in pieces]
    own = jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *each)
    return LaneStart(slots, numbers[:, :count], own, shared, static)


def compiled_chunk(
    start: LaneStart, own: Packed, shared: Packed, rows: int, row: Callable
):
    """Return the compiled loop that makes the attempts of one chunk.

    It is a function of the parts that differ between batch elements, of the shared
    parts (each as numbers and separate leaves) and of the numbers of the batch
    elements; it returns the new numbers of the batch elements and the log.
    A call makes `rows` attempts in each slot, rounded up to whole blocks. `row` is that
    of a `Table`. The log has one array `(rows, slots)` for each number in a row; the
    first array contains the places plus one, and zero where no place is written.
    """
    leaves, structure = jax.tree.flatten(start.static)
    # 1, 1.0 and True compare equal but need different programs
    key = tuple((type(leaf), leaf) for leaf in leaves)
    flat, lane = jax.tree.flatten(start.slots.rows)
    packings = own.packing, shared.packing
    layout = lane, tuple(flat), start.slots.dtypes
    return _chunk(key, structure, packings, layout, rows, row)


@functools.lru_cache(maxsize=256)
def _chunk(
    key: tuple[tuple[type, Hashable], ...], structure, packings, layout, rows, row
):
    static = jax.tree.unflatten(structure, [leaf for _, leaf in key])
    lane, flat, dtypes = layout
    slots = LaneLayout(jax.tree.unflatten(lane, flat), dtypes)

    def numbers_of(record, lane):
        place, values = row(record, lane)
        # rows of a chunk that ends early are zero, which means no place
        return [jnp.asarray(v) for v in (place + 1.0, *values)]

    def one(own, shared, lane):
        parts = [p.unpacked(*q) for p, q in zip(packings, (own, shared), strict=True)]
        system, plan = eqx.combine(*parts, static)
        functions = Functions(system, len(lane.x), plan.plain)
        return attempts(functions, plan, lane, numbers_of)

    mapped = jax.vmap(one, in_axes=((1, 0), None, 0), out_axes=(0, -1))

    def whole(own, shared, numbers):
        some = without_library(
            lambda lanes: mapped(own, shared, lanes), slots.unpacked(numbers)
        )

        def loop(numbers):
            lanes, log = run_many(some, slots.unpacked(numbers), rows, numbers_of)
            return packed(lanes), log

        _, plan = static
        return one_kernel(loop, batch=True, on=not plan.plain)(numbers)

    # the widest vectors of the machine, which XLA avoids by default
    return jax.jit(whole, compiler_options={"xla_cpu_prefer_vector_width": 512})


def split_lanes(system, where, values):
    """Return the system as a batched and a shared part for `filter_vmap`."""
    if where is None:
        return None, system
    nothing = jax.tree.map(lambda _: False, system)
    picked = eqx.tree_at(where, nothing, replace_fn=lambda _: True)
    values = jnp.asarray(values)
    several = isinstance(where(system), tuple)
    full = eqx.tree_at(where, system, tuple(values.T) if several else values)
    return eqx.partition(full, picked)


@eqx.filter_jit
def _ready(batched, shared, period, t0, turns, settings, differentiable: bool):
    """Return the system and the plan, split into the parts that differ between batch
    elements and the shared parts.
    """

    def prepared(batched):
        system = eqx.combine(batched, shared).prepared()
        length = system.period if period is None else period
        t1 = t0 + turns * length
        plan = Plan.of(
            system,
            settings,
            t0,
            t1,
            period=length,
            stop_period=length,
            differentiable=differentiable,
        )
        return system, plan

    if batched is None:
        rest = prepared(None)
        own = jax.tree.map(lambda _: None, rest)
    else:
        ready = eqx.filter_vmap(prepared, in_axes=(eqx.if_array(0),))(batched)
        differs = _depends(prepared, jax.tree.map(lambda p: p[0], batched))
        own, rest = eqx.partition(ready, differs)
        rest = jax.tree.map(lambda p: p[0] if eqx.is_array(p) else p, rest)
    return own, rest


def _first_of(shared, row) -> LoopState:
    """Return the first loop state of one batch element."""
    (t0, rest), (own, state) = shared, row
    system, plan = eqx.combine(own, rest)
    x = tuple(state[i] for i in range(state.shape[0]))
    functions = Functions(system, len(x), plan.plain, shared=True)
    limits = plan.t1, plan.longest_step, plan.repeat
    lane = first_state(functions, t0, x, *limits)
    return jax.tree.map(jnp.asarray, lane)


_FIRST = Rowwise(_first_of)


def _depends(function: Callable, argument):
    """Return whether each leaf of the result depends on the argument."""
    result = eqx.filter_eval_shape(function, argument)
    closed = jax.make_jaxpr(lambda a: eqx.filter(function(a), eqx.is_array))(argument)
    found = iter(dependent(closed))

    def said(leaf):
        return next(found) if isinstance(leaf, jax.ShapeDtypeStruct) else False

    return jax.tree.map(said, result)
