"""Compute the flow map and its Jacobian in one loop compiled by LLVM.

The loop carries, for each variable, the derivative of the loop state, and multiplies it
by the derivative of each attempted step (forward mode). With few variables, it takes a
small fraction of the time to compile that XLA needs for the same derivatives.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..parameters import as_arrays
from ._flow import Arrival, arrival_of, unchecked_flow as unchecked_flow
from ._settings import Settings
from ._started import started
from .backend import (
    Attempts,
    attempts_of,
    key_of,
    Lacking,
    laid_out,
    Rowwise,
    runs_by_llvm as runs_by_llvm,
)
from .caches import Cache
from .dependence import dependent
from .loop import Functions, iteration, LoopState, Plan


# maximum number of numbers in the state of the loop, with all derivatives: the code
# grows with it, and XLA compiles larger programs faster
_MOST = 640


class Moving(NamedTuple):
    """The parts of a loop state that have derivatives; all other parts have none."""

    t: Any
    x: tuple
    jets: tuple
    step: Any

    @staticmethod
    def of(state: LoopState) -> "Moving":
        """Return the parts of a loop state that have derivatives."""
        return Moving(state.t, state.x, state.jets, state.step)

    def put(self, state: LoopState) -> LoopState:
        """Return a loop state with its parts replaced by these."""
        return state._replace(**self._asdict())


class JacobianState(NamedTuple):
    """The loop state with its derivatives, one for each variable.

    The numbers of system and plan that depend on the variables are `active`; they and
    their derivatives are constant.
    """

    state: LoopState
    moving: tuple[Moving, ...]
    active: tuple
    rates: tuple[tuple, ...]


class _Attempt(NamedTuple):
    """Takes one attempted step with its derivatives.

    `shapes` has an entry for each array of system and plan: its shape if it is active,
    otherwise `None`.
    """

    shapes: tuple

    def __call__(self, functions: Functions, plan: Plan, carried: JacobianState):
        arrays, static = eqx.partition((functions.system, plan), eqx.is_array)
        flat, structure = jax.tree.flatten(arrays)

        def attempt(moving: Moving, active: tuple):
            left, whole = iter(active), list(flat)
            for i, shape in enumerate(self.shapes):
                if shape is not None:
                    some = [next(left) for _ in range(int(np.prod(shape)))]
                    whole[i] = jnp.stack(some).reshape(shape)
            parts = jax.tree.unflatten(structure, whole)
            system, moved = eqx.combine(parts, static)
            inner = Functions(
                system, functions.n, moved.plain, shared=True, branches=True
            )
            after, record = iteration(inner, moved, moving.put(carried.state))
            return Moving.of(after), (after, record)

        def along(*tangent):
            given = Moving.of(carried.state), carried.active
            return jax.jvp(attempt, given, tangent, has_aux=True)

        stacked = [
            jax.tree.map(lambda *parts: jnp.stack(parts), *each)
            for each in (carried.moving, carried.rates)
        ]
        mapped = jax.vmap(along, out_axes=(None, 0, None))
        _, moving, (after, record) = mapped(*stacked)
        columns = tuple(
            jax.tree.map(lambda leaf, k=k: leaf[k], moving)
            for k in range(len(carried.moving))
        )
        return carried._replace(state=after, moving=columns), record


class _Started(NamedTuple):
    """System and plan, the first state of the loop, and the shapes for `_Attempt`."""

    system: Any
    plan: Plan
    first: JacobianState
    shapes: tuple


def _start(case, _=None) -> _Started:
    setup, given, settings, y = case

    def begun(y):
        system, state, *times = setup(given, y)
        t0, t1 = (jnp.asarray(t, jnp.float64) for t in times)
        _, plan, carried = started(
            system.prepared(), settings, t0, state, t1, differentiable=True, shared=True
        )
        return (system.prepared(), plan), jax.tree.map(jnp.asarray, carried)

    def arrays(y):
        return jax.tree.leaves(eqx.filter(begun(y)[0], eqx.is_array))

    closed, leaves = jax.make_jaxpr(arrays, return_shape=True)(y)
    varying_leaves = [a for a, v in zip(leaves, dependent(closed), strict=True) if v]
    if not all(jnp.issubdtype(a.dtype, jnp.inexact) for a in varying_leaves):
        raise Lacking("derivatives of integers")
    shapes = tuple(
        leaf.shape if varies else None
        for leaf, varies in zip(leaves, dependent(closed), strict=True)
    )

    def varying(y):
        both, carried = begun(y)
        flat = jax.tree.leaves(eqx.filter(both, eqx.is_array))
        active = [a for a, s in zip(flat, shapes, strict=True) if s is not None]
        numbers = tuple(a.ravel()[k] for a in active for k in range(a.size))
        return (Moving.of(carried), numbers), (both, carried)

    def along(direction):
        return jax.jvp(varying, (y,), (direction,), has_aux=True)

    mapped = jax.vmap(along, out_axes=(None, 0, None))
    (_, numbers), tangents, (both, carried) = mapped(jnp.eye(y.shape[0]))
    moving, rates = zip(
        *(jax.tree.map(lambda a, k=k: a[k], tangents) for k in range(y.shape[0])),
        strict=True,
    )
    system, plan = both
    first = JacobianState(carried, moving, numbers, rates)
    number = len(jax.tree.leaves(first))
    if number > _MOST:
        raise Lacking(f"derivatives of {number} numbers of a state and a system")
    return _Started(system, plan, first, shapes)


_STARTED = Rowwise(_start, width=1)
_LOOPS = Cache()


class _Loop(NamedTuple):
    """The compiled loop for one kind of arguments."""

    attempts: Attempts
    # how many numbers belong to system and plan
    shared: int
    # the place of each scalar in the state of the loop
    place: JacobianState

    @staticmethod
    def of(begun: _Started) -> "_Loop":
        arrays, static = eqx.partition((begun.system, begun.plan), eqx.is_array)
        _, shared = laid_out(arrays)
        _, nothing = laid_out(jax.tree.map(lambda _: None, arrays))
        numbers, lane = laid_out(begun.first)
        step = _Attempt(begun.shapes)
        key = key_of(static, nothing, shared, begun.first, _row, 2, step)
        place = jax.tree.unflatten(lane.structure, range(len(numbers)))
        return _Loop(attempts_of(key), shared.size, place)


def _row(record, lane: JacobianState):
    return lane.state.steps - 1.0, [record.kind, record.constraint]


def _begun(case) -> tuple[_Loop, np.ndarray, np.ndarray]:
    """Return the loop, the numbers of system and plan, and the first state,
    `(1, k)`.
    """

    def first_of(tree) -> _Started:
        return jax.tree.map(lambda a: a[0] if isinstance(a, np.ndarray) else a, tree)

    try:
        numbers = _STARTED.numbers(case)
    except Lacking:
        # only the start needs the operation, for example to prepare a cam profile
        begun = first_of(_STARTED(case, (), 1, compiles=False))
        loop = _Loop.of(begun)
        arrays = eqx.filter((begun.system, begun.plan), eqx.is_array)
        shared, _ = laid_out(arrays)
        return loop, shared, laid_out(begun.first)[0][None]
    program, made = numbers.program, numbers.made[0]

    def make() -> _Loop:
        return _Loop.of(first_of(program.tree(numbers.made)))

    loop = _LOOPS.get(program.function, make)
    return loop, made[: loop.shared].copy(), made[None, loop.shared :].copy()


def flow_jacobian(
    setup: Callable, given: Any, y, settings: Settings, max_steps: int = 4096
) -> tuple[Arrival, Float[Array, "n k"]]:
    """Return the end of a motion and the Jacobian of its state with respect to `y`.

    It is not for use inside a transformation.

    **Arguments:** `setup(given, y)`, which returns the system, the initial state, the
    start and the end time (s); `given`, a pytree of arrays and hashable parts; and the
    variables `y`, `(k,)`.

    **Raises:** `Lacking` with the name of an operation that the backend does not have.
    """
    given, settings = as_arrays(given), as_arrays(settings)
    loop, shared, lane = _begun((setup, given, settings, jnp.asarray(y, jnp.float64)))
    place = loop.place
    mode = lane[0, list(place.state.mode)] > 0.5
    table = np.zeros((1, max_steps, 2))
    loop.attempts.run(shared, np.zeros((1, 0)), lane, table, limit=max_steps)
    end = jax.tree.map(lambda k: lane[0, k], place.state)
    columns = [lane[0, list(moving.x)] for moving in place.moving]
    kinds, places = table[0, : int(end.steps)].T
    return arrival_of(end, kinds, places, mode), jnp.asarray(np.stack(columns, axis=1))
