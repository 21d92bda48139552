"""The flow map alone: where a trajectory ends, without a record of how it got there."""

import functools

import diffrax
import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ..parameters import as_arrays, real_array, VectorLike
from ._settings import Settings
from ._system import HybridSystem
from ._types import RealScalar
from .checks import check_system, is_traced, is_tracing
from .codes import RUNNING
from .loop import first_state, Functions, iteration, Plan
from .lowering import depend_on, one_kernel, whole, with_kept


# iterations before it is asked whether any lane still runs
_BLOCK = 4


class Arrival(eqx.Module):
    """Where a trajectory ends."""

    #: (n,) state at the end
    state: Float[Array, " n"]
    #: (m,) which constraints are in contact at the end
    contact: Bool[Array, " m"]
    #: number of impacts, and of attempted steps
    impacts: Float[Array, ""]
    steps: Float[Array, ""]
    #: 0 where the end was reached, else an index into `RESULTS`
    code: Int[Array, ""]


def flow(
    system: HybridSystem,
    state: VectorLike,
    t0: RealScalar,
    t1: RealScalar,
    *,
    settings: Settings | None = None,
    max_steps: int = 4096,
) -> Arrival:
    """Where the motion from `state` at `t0` is at `t1`; for use inside `jit`.

    Pure: it can be compiled, batched with `vmap` and differentiated (`jvp`, `grad`,
    `linearize`, nested) with respect to state, times and parameters; a gradient costs a
    forward derivative in every number differentiated by. What cannot start (behind a
    constraint, not finite, t1 before t0) has a code of its own and state NaN; where
    nothing is traced, the system is checked.
    The number of impacts, contacts and releases may differ from lane to lane.

    **Arguments:**

    - `state`: shape `(n,)`, with every gap >= 0.
    - `t0`, `t1`: s, t1 >= t0.
    - `settings`: accuracy; `Settings()` by default.
    - `max_steps`: budget of attempted steps.

    **Returns:** an `Arrival`; its `code` is an index into `RESULTS`.

    **Raises:** `ValueError` for a complex state; and for parameters or functions of the
    system that cannot be, where nothing is traced.
    """
    state = real_array(state)
    system = as_arrays(system)
    if not is_traced((system, state, t0)) and not is_tracing():
        check_system(system, jnp.asarray(t0, jnp.float64), state)
    if settings is None:
        settings = Settings(solver=diffrax.Dopri8())
    settings = as_arrays(settings)
    t0, t1 = jnp.asarray(t0, jnp.float64), jnp.asarray(t1, jnp.float64)
    run = _flow if settings.plain else whole(_flow)
    return run(system, settings, state, t0, t1, max_steps)


def _flow(system, settings, state, t0, t1, max_steps: int) -> Arrival:
    system = system.prepared()
    functions = Functions(system, state.shape[0], settings.plain)
    plan = Plan.of(system, settings, t0, t1)
    x = tuple(state[i] for i in range(state.shape[0]))
    carried = first_state(functions, t0, x, t1, plan.longest_step, plan.repeat)
    carried = jax.tree.map(jnp.asarray, carried)
    body, kept = with_kept(
        lambda carried: (iteration(functions, plan, carried)[0], jnp.zeros(())),
        carried,
        on=not settings.plain,
    )

    def unfinished(carry):
        count, (carried, _) = carry
        return (count < max_steps) & eqxi.unvmap_any(carried.status == RUNNING)

    def several(carry):
        count, carried = carry
        carried, _ = jax.lax.scan(lambda s, _: body(s), carried, None, length=_BLOCK)
        return count + _BLOCK, carried

    start = (jnp.asarray(0, jnp.int32), (carried, kept))
    loop = functools.partial(jax.lax.while_loop, unfinished, several)
    _, (carried, kept) = one_kernel(loop, on=not settings.plain)(start)
    return Arrival(
        state=jnp.stack(carried.x),
        contact=jnp.stack(carried.contact),
        impacts=carried.impacts,
        steps=depend_on(carried.steps, kept),
        code=carried.status.astype(jnp.int32),
    )
