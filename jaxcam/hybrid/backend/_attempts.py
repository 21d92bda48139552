"""Compile the attempted steps of the event loop for this machine, and run them."""

import ctypes
import logging
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.interpreters import partial_eval

from ..caches import Cache
from ..loop import Functions, iteration, loop_state
from ._kernel import COUNTERS, ENTRY, module_of, Program, ROUNDS, UNFINISHED
from ._layout import Layout
from ._machine import Compiled, compiled
from ._writer import compiled_or_lacking, Lacking


# maximum number of rounds of attempts per call; between calls, a run can be interrupted
# and its progress reported
_PATIENCE = 200_000
_POINTERS = (ctypes.c_void_p,) * 8
_ARGUMENTS = (
    *_POINTERS,
    ctypes.c_int64,
    ctypes.c_int64,
    ctypes.c_double,
    ctypes.c_double,
    ctypes.c_int64,
)
_LOG = logging.getLogger("jaxcam")
_SAID: set[str] = set()


class Key(NamedTuple):
    """The hashable key of a compiled attempted step."""

    # non-array parts of the system and the plan, with types and positions
    static: tuple
    structure: Any
    # layouts of the arrays of the system and the plan: of those that differ between
    # batch elements, and of those that are shared
    own: Layout
    shared: Layout
    # pytree of the scalars of the state, and their types
    lane: Any
    dtypes: tuple
    # function of the record of an attempt and of the state after it, which returns a
    # place in the log and the numbers of a row
    row: Callable
    width: int
    # function that takes one attempted step, given `Functions`, the plan and the state
    step: Callable


def key_of(
    static, own: Layout, shared: Layout, lane, row, width, step: Callable = iteration
) -> Key:
    """Return the key of an attempt; `lane` is an example of the state of an element."""
    leaves, structure = jax.tree.flatten(static)
    scalars, lane_structure = jax.tree.flatten(lane)
    # 1, 1.0 and True compare equal but need different programs
    kinds = tuple((type(leaf), leaf) for leaf in leaves)
    dtypes = tuple(np.dtype(s.dtype) for s in scalars)
    return Key(kinds, structure, own, shared, lane_structure, dtypes, row, width, step)


def traced(key: Key) -> Program:
    """Return one attempted step as a traced program."""
    static = jax.tree.unflatten(key.structure, [leaf for _, leaf in key.static])

    def attempt(own, shared, *scalars):
        parts = key.own.tree(own), key.shared.tree(shared)
        system, plan = eqx.combine(*parts, static)
        lane = jax.tree.unflatten(key.lane, scalars)
        functions = Functions(
            system, len(loop_state(lane).x), plan.plain, shared=True, branches=True
        )
        after, record = key.step(functions, plan, lane)
        place, values = key.row(record, after)
        return [jnp.asarray(v) for v in (*jax.tree.leaves(after), place, *values)]

    def shape(number):
        return jax.ShapeDtypeStruct((number,), jnp.float64)

    scalars = [jax.ShapeDtypeStruct((), dtype) for dtype in key.dtypes]
    sizes = key.own.size, key.shared.size
    closed = jax.make_jaxpr(attempt)(*map(shape, sizes), *scalars)
    wanted = [True] * len(closed.jaxpr.outvars)
    pruned, _ = partial_eval.dce_jaxpr(closed.jaxpr, wanted, instantiate=True)
    places = loop_state(jax.tree.unflatten(key.lane, range(len(scalars))))
    return Program(
        pruned,
        closed.consts,
        key.dtypes,
        places.status,
        places.steps,
        key.shared.size,
        key.own.size,
        len(closed.jaxpr.outvars) - len(scalars) - 1,
    )


class Sizes(NamedTuple):
    """The numbers of values in the state of a batch element, in its own data, and in a
    row of the log.
    """

    state: int
    own: int
    row: int
    # index of the attempt counter in the state
    steps: int


def sizes_of(program: Program) -> Sizes:
    """Return the `Sizes` of a program."""
    return Sizes(len(program.dtypes), program.own, program.row, program.steps)


class Attempts:
    """The compiled loop of attempts for one key."""

    def __init__(self, key: Key):
        program = traced(key)
        # only the sizes of the program are kept, because the program takes megabytes
        self.sizes = sizes_of(program)
        self.width = key.width
        text = str(module_of(program, key.width))
        self.function: Compiled = compiled(text, ENTRY, None, _ARGUMENTS)

    def run(
        self,
        shared: np.ndarray,
        own: np.ndarray,
        lanes: np.ndarray,
        table: np.ndarray,
        *,
        first: float = 0.0,
        limit: float,
        between: Callable[[], None] | None = None,
    ) -> int:
        """Run batch elements to the end, or to `limit` attempts each.

        **Arguments:** the values of system and plan: those that are `shared`, `(k,)`,
        and each element's `own`, `(elements, k)`; the states (`lanes`), `(elements,
        k)`, which are changed in place; the log (`table`), `(elements, places, k)`,
        which begins with the place `first`; and a function that is called `between`
        calls of the compiled loop.

        **Returns:** the number of attempts in each slot.
        """
        count, width = len(lanes), self.width
        columns = self.sizes.state + self.sizes.own
        slots = np.zeros((columns, width))
        work = np.full(width, -1, dtype=np.int64)
        order, counters = np.arange(count), np.zeros(len(COUNTERS), dtype=np.int64)
        arrays = shared, own, lanes, slots, work, order, counters, table
        assert all(a.flags.c_contiguous for a in arrays)
        pointers = [a.ctypes.data for a in arrays]
        numbers = count, table.shape[1], float(first), float(limit), _PATIENCE
        while True:
            counters[UNFINISHED] = 0
            self.function(*pointers, *numbers)
            if not counters[UNFINISHED]:
                return int(counters[ROUNDS])
            if between is not None:
                between()


_KNOWN = Cache()


def attempts_of(key: Key) -> Attempts:
    """Return the loop for a key; it is compiled only once.

    **Raises:** `Lacking` if the program needs an operation that the backend does not
    have.
    """
    return compiled_or_lacking(_KNOWN, key, lambda: Attempts(key))


def say_lacking(lacking: Lacking, demanded: bool) -> None:
    """Report once that a system runs with XLA, because LLVM cannot compile it.

    **Raises:** `ValueError` instead if LLVM is `demanded`.
    """
    text = (
        "the LLVM backend cannot compile this system, because it does not "
        f'support {lacking}; Settings(backend="auto") runs the system with XLA, '
        "which is slower"
    )
    if demanded:
        raise ValueError(text) from lacking
    if str(lacking) not in _SAID:
        _SAID.add(str(lacking))
        _LOG.warning(
            ("the system runs with XLA, because the LLVM backend does not support %s"),
            lacking,
        )
