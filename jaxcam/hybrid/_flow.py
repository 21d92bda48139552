"""The flow map alone: where a trajectory ends, without a record of how it got there."""

import diffrax
import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ._advance import Plan
from ._functions import Functions
from ._lane import first_lane, RUNNING
from ._loop import iterate
from ._materialise import depend_on, with_kept
from ._one_kernel import one_kernel
from ._settings import Settings
from ._system import HybridSystem, with_array_parameters
from ._types import RealScalar


# iterations between two looks at whether any lane still runs
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
    state: Float[Array, " n"],
    t0: RealScalar,
    t1: RealScalar,
    *,
    settings: Settings | None = None,
    max_steps: int = 4096,
) -> Arrival:
    """Where the motion from `state` at `t0` is at `t1`; for use inside `jit`.

    Pure: it can be compiled, batched with `vmap` and differentiated forward (`jvp`,
    `jacfwd`, nested) with respect to state, times and parameters, and checks nothing.
    The number of impacts, contacts and releases may differ from lane to lane.

    **Arguments:**

    - `state`: shape `(n,)`, with every gap >= 0.
    - `t0`, `t1`: s, t1 >= t0.
    - `settings`: accuracy; `Settings()` by default.
    - `max_steps`: budget of attempted steps.

    **Returns:** a [`jaxcam.hybrid.Arrival`][]; its `code` is an index into `RESULTS`.
    """
    system = with_array_parameters(system).prepared()
    if settings is None:
        settings = Settings(solver=diffrax.Dopri8())
    settings = with_array_parameters(settings)
    t0, t1 = jnp.asarray(t0, jnp.float64), jnp.asarray(t1, jnp.float64)
    functions = Functions(system, state.shape[0])
    plan = Plan.of(system, settings, t0, t1)
    x = tuple(state[i] for i in range(state.shape[0]))
    lane = jax.tree.map(jnp.asarray, first_lane(functions, t0, x, t1))
    body, kept = with_kept(
        lambda lane: (iterate(functions, plan, lane)[0], jnp.zeros(())), lane
    )

    def unfinished(carry):
        count, (lane, _) = carry
        return (count < max_steps) & eqxi.unvmap_any(lane.status == RUNNING)

    def several(carry):
        count, lane = carry
        lane, _ = jax.lax.scan(lambda s, _: body(s), lane, None, length=_BLOCK)
        return count + _BLOCK, lane

    start = (jnp.asarray(0, jnp.int32), (lane, kept))
    loop = one_kernel(lambda start: jax.lax.while_loop(unfinished, several, start))
    _, (lane, kept) = loop(start)
    order = jnp.array([1, 0, 2, 3], dtype=jnp.int32)
    return Arrival(
        state=jnp.stack(lane.x),
        contact=jnp.stack(lane.contact),
        impacts=lane.impacts,
        steps=depend_on(lane.steps, kept),
        code=order[lane.status.astype(jnp.int32)],
    )
