"""The front door: `simulate`."""

from collections.abc import Callable
from typing import Literal

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from ._advance import Plan
from ._assemble import assemble, Parts
from ._check import check_start, is_traced
from ._events import Contacts, Impacts, Steps
from ._functions import Functions
from ._lane import first_lane, Lane, RUNNING
from ._release_point import release_point
from ._run import Log, run, run_reversible
from ._runge_kutta import tableau_of
from ._segments import simulate_segments
from ._settings import Settings
from ._system import HybridSystem, with_array_parameters
from ._trajectory import Trajectory
from ._types import RealScalar


# rows run before Python looks again: for progress, interruption and growing logs
_CHUNK = 2048


def simulate(
    system: HybridSystem,
    state: Float[ArrayLike, " n"] | None,
    t0: RealScalar,
    t1: RealScalar,
    *,
    tolerance: float = 1e-10,
    solver: diffrax.AbstractSolver | None = None,
    settings: Settings | None = None,
    max_steps: int | None = None,
    derivatives: Literal["forward", "reverse"] = "forward",
    engine: Literal["loop", "diffeqsolve"] = "loop",
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """The exact trajectory of a hybrid system from `t0` to `t1`.

    **Arguments:**

    - `system`: a [`jaxcam.hybrid.HybridSystem`][].
    - `state`: shape `(n,)`, with every gap >= 0; or `None` for the orbit released last
      from contact (systems with a period, two states and one constraint): in contact at
      `t0` where contact holds then, else from the last release before `t0` on.
    - `t0`, `t1`: s, t1 >= t0.
    - `tolerance`: error allowed in a step, relative and absolute.
    - `solver`: any explicit Runge-Kutta solver of diffrax, `Dopri8` by default.
    - `settings`: everything else about accuracy; overrides `tolerance` and `solver`.
    - `max_steps`: budget of attempted steps. Without it a run outside of any
      transformation grows as needed, up to a million; inside `jit`, `vmap`, `jvp` or
      `grad`, where sizes must be known, it is 4096 and arrays are padded.
    - `derivatives`: "forward" (jvp, jacfwd) or "reverse" (grad): the latter always runs
      `max_steps` attempts.
    - `engine`: "loop", or "diffeqsolve" for one diffrax call a flight (implicit
      solvers, an independent check).
    - `progress`: called with the fraction done, now and then.

    **Returns:** a [`jaxcam.hybrid.Trajectory`][]. Where it did not reach t1,
    `trajectory.result` says why.

    **Raises:** `ValueError` naming the fix: a state that is not finite or behind the
    constraint, t1 < t0, a setting out of range, functions of the wrong shape.
    """
    if settings is None:
        chosen = diffrax.Dopri8() if solver is None else solver
        settings = Settings(tolerance=tolerance, solver=chosen)
    if engine not in ("loop", "diffeqsolve"):
        raise ValueError(f'engine is {engine!r}; choose "loop" or "diffeqsolve"')
    if derivatives not in ("forward", "reverse"):
        raise ValueError(
            f'derivatives is {derivatives!r}; choose "forward" or "reverse"'
        )
    t0, t1 = jnp.asarray(t0, dtype=jnp.float64), jnp.asarray(t1, dtype=jnp.float64)
    system = with_array_parameters(system)
    settings = with_array_parameters(settings)
    traced = is_traced((system, state, t0, t1, settings))
    if state is None:
        state, t_start = _released(system, t0, traced)
    else:
        state, t_start = jnp.asarray(state, dtype=jnp.float64), t0
    if not traced:
        check_start(system, settings, t_start, state, t1)
    if engine == "diffeqsolve":
        if traced:
            raise ValueError(
                'engine="diffeqsolve" is driven from Python and cannot be traced by '
                'jit, vmap or grad; use engine="loop" there'
            )
        budget = 1_000_000 if max_steps is None else max_steps
        log, contact, code = simulate_segments(
            system, settings, t_start, state, t1, budget, progress
        )
        parts = _assemble(system, t_start, state, contact, log)
        return Trajectory(system, settings, t0, t1, *_trim(parts), code)
    tableau_of(settings.solver)
    if traced or derivatives == "reverse":
        rows = 4096 if max_steps is None else max_steps
        log, contact, code = _whole(
            system, settings, t_start, state, t1, rows, derivatives
        )
        parts = assemble(system, t_start, state, contact, log, (rows, rows))
        if traced:
            return Trajectory(system, settings, t0, t1, *parts, code)
    else:
        budget = 1_000_000 if max_steps is None else max_steps
        log, contact, code = _chunks(
            system, settings, t_start, state, t1, budget, progress
        )
        parts = _assemble(system, t_start, state, contact, log)
    return Trajectory(system, settings, t0, t1, *_trim(parts), code)


def _released(system, t0, traced):
    """Start of the orbit released last before t0."""
    if not traced:
        system.check()
    if system.period is None:
        raise ValueError(
            "state=None needs a system with a forcing period; pass the state to start "
            "from"
        )
    names = system.state_names
    if (names and len(names) != 2) or _constraints(system, t0) != 1:
        raise ValueError(
            "state=None needs a system with two states and one constraint; pass the "
            "state to start from"
        )
    state, time, nowhere = _release_point(system, t0)
    if not traced and bool(nowhere):
        raise ValueError(
            "there is no contact anywhere in the period, so no release point; pass the "
            "state to start from"
        )
    return state, time


def _constraints(system, t0) -> int:
    state = jax.ShapeDtypeStruct((2,), jnp.float64)
    gap = jax.eval_shape(system.gap, t0, state)
    return gap.shape[0] if gap.shape else 1


@eqx.filter_jit
def _release_point(system, t0):
    """State (NaN where there is no release), time, and whether there is none."""
    point = release_point(system, t0)
    nowhere = point.holds == 2
    return jnp.where(nowhere, jnp.nan, point.state), point.time, nowhere


def _prepare(system, settings, t0, state, t1):
    system = system.prepared()
    functions = Functions(system, state.shape[0])
    plan = Plan.of(system, settings, t0, t1)
    x = tuple(state[i] for i in range(state.shape[0]))
    lane = first_lane(functions, t0, x, t1)
    return functions, plan, lane


def _whole(system, settings, t0, state, t1, rows, derivatives):
    functions, plan, lane = _prepare(system, settings, t0, state, t1)
    contact = jnp.stack(lane.contact)
    runner = run if derivatives == "forward" else run_reversible
    lane, log = runner(functions, plan, lane, rows)
    return log, contact, _code(lane)


@eqx.filter_jit
def _begin(system, settings, t0, state, t1, rows):
    functions, plan, lane = _prepare(system, settings, t0, state, t1)
    contact = jnp.stack(lane.contact)
    lane, log = run(functions, plan, lane, rows, "one")
    return lane, log, contact


@eqx.filter_jit
def _go_on(system, settings, t0, state, t1, lane: Lane, rows):
    functions, plan, _ = _prepare(system, settings, t0, state, t1)
    return run(functions, plan, lane, rows, "one")


def _assemble(system, t0, state, contact, log: Log) -> Parts:
    """The parts of a run that is not traced."""
    t0, state, contact, log = jax.tree.map(np.asarray, (t0, state, contact, log))
    log = Log(*(part[log.kind > 0] for part in log))
    rows, width = log.contact.shape
    # contacts that hold at the start belong to no row
    sizes = rows, width * (rows + 1)
    return assemble(system, t0, state, contact, log, sizes, np)


def _chunks(system, settings, t0, state, t1, budget, progress):
    """Run chunk by chunk, as far as the budget goes."""
    size = min(_CHUNK, budget)
    lane, log, contact = _begin(system, settings, t0, state, t1, size)
    logs, used = [log], size
    start = float(t0)
    span = max(float(t1) - start, 1e-300)
    while float(lane.status) == RUNNING and used < budget:
        if progress is not None:
            progress((float(lane.t) - start) / span)
        lane, log = _go_on(system, settings, t0, state, t1, lane, size)
        logs.append(log)
        used += size
    if progress is not None:
        progress(1.0)
    whole = jax.tree.map(lambda *parts: np.concatenate(parts), *logs)
    return whole, contact, _code(lane)


@jax.jit
def _code(lane: Lane):
    """Index into `RESULTS`; a lane that still runs has used up its budget."""
    order = jnp.array([1, 0, 2, 3], dtype=jnp.int32)
    return order[lane.status.astype(jnp.int32)]


def _trim(parts: Parts) -> Parts:
    def cut(part):
        number = int(part.count)
        # in numpy: jax would compile a slice for every new length; copied, or the whole
        # log would stay in memory with it
        return jax.tree.map(
            lambda a: np.asarray(a)[:number].copy() if a.ndim else a, part
        )

    impacts, contacts, steps = jax.device_put([cut(part) for part in parts])
    return Parts(
        _as(Impacts, impacts),
        _as(Contacts, contacts),
        _as(Steps, steps),
    )


def _as(kind, part):
    assert isinstance(part, kind)
    return part
