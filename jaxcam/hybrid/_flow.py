"""Compute the flow map: the final state, without a record of the events."""

import dataclasses
import functools

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..parameters import as_arrays, real_array, VectorLike
from ._compiled_run import run_compiled
from ._event_counts import EventCounts, EventOrder
from ._prepared import prepared
from ._settings import Settings
from ._system import HybridSystem
from ._types import RealScalar
from .backend import runs_by_llvm
from .checks import check_system
from .codes import RUNNING
from .loop import first_state, Functions, iteration, LoopState, Plan
from .lowering import depend_on, one_kernel, whole, with_kept
from .programs import is_outermost, is_traced, is_tracing, program


# number of iterations between two checks of whether a batch element is still running
_BLOCK = 4


class Arrival(eqx.Module):
    """The end of a trajectory, returned by [`jaxcam.hybrid.flow`][]."""

    state: Float[Array, " n"]
    """State at the end, shape `(n,)`."""
    contact: Bool[Array, " m"]
    """Constraints in contact at the end, shape `(m,)`."""
    impacts: Float[Array, ""]
    """Number of impacts."""
    steps: Float[Array, ""]
    """Number of attempted integration steps."""
    code: Int[Array, ""]
    """Index into `RESULTS`; 0 if the run reached the end."""
    events: EventCounts
    """Numbers of events between start and end."""
    start: Bool[Array, " flags"]
    """Mode at the start, shape `(m + 2 k,)` for m constraints and k switching surfaces:
    constraints in contact, then surfaces on whose negative side the motion starts, then
    surfaces along which it slides.
    """


def flow(
    system: HybridSystem,
    state: VectorLike,
    t0: RealScalar,
    t1: RealScalar,
    *,
    settings: Settings | None = None,
    max_steps: int = 4096,
) -> Arrival:
    """Return the state at `t1` of the motion that starts from `state` at `t0`.

    The function is pure: it can be compiled (`jit`), batched (`vmap`) and
    differentiated (`jvp`, `grad`, `linearize`, nested) with respect to state, times and
    parameters. A gradient costs one forward derivative per differentiation variable.
    Outside of transformations, the loop is compiled by LLVM, like that of
    [`jaxcam.hybrid.simulate`][]; the state at a release is then computed by a series.
    Inside transformations, the step is repeated so that it ends exactly at the release,
    as derivatives require. The numbers of impacts, contacts and releases may differ
    between batch elements. If the start is invalid (a negative gap, a state that is not
    finite, or t1 < t0), `code` gives the reason and the final state is NaN. Outside of
    transformations, the settings and the system are checked first.

    Args:
        system: The system to simulate.
        state: Initial state, shape `(n,)`, with every gap >= 0.
        t0: Start time (s).
        t1: End time (s), t1 >= t0.
        settings: Accuracy; default: `Settings()`.
        max_steps: Maximum number of attempted integration steps.

    Returns:
        An `Arrival`, whose `code` is an index into `RESULTS`.

    Raises:
        ValueError: The state is complex; or, outside of transformations, a setting, a
            parameter or a function of the system is invalid.

    Examples:
        >>> from jaxcam.hybrid import flow
        >>> from jaxcam.models import BouncingBall
        >>> float(flow(BouncingBall(), jnp.array([1.0, 0.0]), 0.0, 1.0).impacts)
        1.0
    """
    state = real_array(state)
    system = as_arrays(system)
    settings = as_arrays(Settings() if settings is None else settings)
    if not is_tracing():
        if not is_traced(settings):
            settings.check()
        if not is_traced((system, state, t0)):
            check_system(system, jnp.asarray(t0, jnp.float64), state, settings)
    return unchecked_flow(system, state, t0, t1, settings, max_steps)


def unchecked_flow(
    system, state, t0, t1, settings: Settings, max_steps: int = 4096
) -> Arrival:
    """Return the same as `flow`, without its checks; for solvers, whose iterates may be
    invalid.
    """
    t0, t1 = jnp.asarray(t0, jnp.float64), jnp.asarray(t1, jnp.float64)
    case = system, settings, state, t0, t1
    made = runs_by_llvm(settings, case, lambda: _by_llvm(*case, max_steps))
    if made is not None:
        return made
    return (_by_xla if is_outermost() else _traced)(*case, max_steps)


def _by_llvm(system, settings, state, t0, t1, max_steps: int) -> Arrival:
    case = prepared(system), settings, t0, state, t1
    made = run_compiled(case, max_steps)
    kinds, places = np.asarray(made.log.kind), np.asarray(made.log.constraint)
    return arrival_of(made.end, kinds, places, made.mode)


def _traced(system, settings, state, t0, t1, max_steps: int) -> Arrival:
    run = _flow if settings.plain else whole(_flow)
    return run(system, settings, state, t0, t1, max_steps)


# outside of transformations, one trace serves all runs of this kind
_by_xla = program(_traced)


def arrival_of(end: LoopState, kinds, places, mode) -> Arrival:
    """Return the `Arrival` of a run that is not traced.

    **Arguments:** the loop state at its end, the kinds of its attempted steps, their
    constraints or surfaces, and the mode at its start.
    """
    return Arrival(
        state=jnp.asarray(end.x),
        contact=jnp.asarray(end.contact, dtype=bool),
        impacts=jnp.asarray(end.impacts),
        steps=jnp.asarray(end.steps),
        code=jnp.asarray(int(end.status), dtype=jnp.int32),
        events=EventCounts.of(kinds, places),
        start=jnp.asarray(mode),
    )


def _flow(system, settings, state, t0, t1, max_steps: int) -> Arrival:
    system = system.prepared()
    functions = Functions(system, state.shape[0], settings.plain)
    plan = Plan.of(system, settings, t0, t1)
    x = tuple(state[i] for i in range(state.shape[0]))
    carried = first_state(functions, t0, x, t1, plan.longest_step, plan.repeat)
    carried = jax.tree.map(jnp.asarray, carried)
    start = carried.flags

    def attempt(both):
        carried, events, order = both
        carried, record = iteration(functions, plan, carried)
        kind, place = (
            jax.lax.stop_gradient(jnp.asarray(one, jnp.float64))
            for one in (record.kind, record.constraint)
        )
        after = carried, events.after(kind), order.after(kind, place)
        return after, jnp.zeros(())

    first = carried, EventCounts.zero(), EventOrder.zero(functions.m + functions.k)
    body, kept = with_kept(attempt, first, on=not settings.plain)

    def unfinished(carry):
        count, ((carried, *_), _) = carry
        return (count < max_steps) & eqxi.unvmap_any(carried.status == RUNNING)

    def several(carry):
        count, carried = carry
        carried, _ = jax.lax.scan(lambda s, _: body(s), carried, None, length=_BLOCK)
        return count + _BLOCK, carried

    begin = (jnp.asarray(0, jnp.int32), (first, kept))
    loop = functools.partial(jax.lax.while_loop, unfinished, several)
    _, ((carried, events, order), kept) = one_kernel(loop, on=not settings.plain)(begin)
    return Arrival(
        state=jnp.stack(carried.x),
        contact=jnp.stack(carried.contact) if functions.m else jnp.zeros(0, bool),
        impacts=carried.impacts,
        steps=depend_on(carried.steps, kept),
        code=carried.status.astype(jnp.int32),
        events=dataclasses.replace(events, order=order.sign),
        start=start,
    )
