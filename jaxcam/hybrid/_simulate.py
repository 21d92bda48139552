"""Simulate a hybrid system: `simulate`."""

from collections.abc import Callable
from typing import Any, Literal

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from ..parameters import FloatScalar, real_array, VectorLike
from ._converted import Converted
from ._prepared import prepared
from ._settings import Settings
from ._switched import SwitchedSystem
from ._system import HybridSystem
from ._types import RealScalar
from ._untraced import prepare, run_untraced
from .caches import Latest
from .checks import check_arguments, check_gaps
from .codes import BEHIND, NOT_FINITE, PAINLEVE, RUNNING
from .loop import Log, LoopState, run, run_reversible
from .lowering import whole
from .programs import is_traced, program
from .record import (
    assemble,
    Contacts,
    Impacts,
    Parts,
    Steps,
    Switches,
    Trajectory,
)
from .runge_kutta import tableau_of
from .segments import simulate_segments
from .surface import release_point


# the same system and settings are often passed to many runs
_SYSTEM, _SETTINGS = Converted(), Converted()
# the settings whose solver has been found usable
_USABLE = Latest()


def _check_choices(engine: str, derivatives: str) -> None:
    if engine not in ("loop", "diffeqsolve"):
        raise ValueError(f'engine is {engine!r}; choose "loop" or "diffeqsolve"')
    if derivatives not in ("forward", "reverse"):
        raise ValueError(
            f'derivatives is {derivatives!r}; choose "forward" or "reverse"'
        )


def simulate(
    system: HybridSystem,
    state: VectorLike | None,
    t0: RealScalar,
    t1: RealScalar,
    *,
    tolerance: FloatScalar | None = None,
    solver: diffrax.AbstractSolver | None = None,
    settings: Settings | None = None,
    max_step: FloatScalar | None = None,
    max_steps: int | None = None,
    derivatives: Literal["forward", "reverse"] = "forward",
    engine: Literal["loop", "diffeqsolve"] = "loop",
    progress: Callable[[float], None] | None = None,
) -> Trajectory:
    """Simulate a hybrid system from `t0` to `t1` and return its trajectory.

    Args:
        system: A [`jaxcam.hybrid.HybridSystem`][].
        state: Initial state, shape `(n,)`, with every gap >= 0. `None` (for
            systems with a period, two states and one constraint) starts in contact at
            `t0` if contact is maintained then, otherwise at the last release before
            `t0`.
        t0: Start time (s).
        t1: End time (s), t1 >= t0.
        tolerance: Error allowed per step, relative to the distance that each component
            moves; default: 1e-10.
        solver: Explicit Runge-Kutta solver from diffrax; default: `Dopri8`.
        settings: All accuracy settings, instead of `tolerance`, `solver` and
            `max_step`.
        max_step: Longest integration step (s). The solver may step over a force that is
            briefer, or a barrier that is narrower, than one step.
        max_steps: Maximum number of attempted steps. The default is a million; inside
            `jit`, `vmap`, `jvp` or `grad`, where array sizes must be fixed, it is 4096,
            and arrays are padded.
        derivatives: "forward", or "reverse" for gradients with respect to hundreds of
            numbers; both support jvp, linearize, grad and hessian. "reverse" always
            performs `max_steps` attempts.
        engine: "loop", or "diffeqsolve" for one diffrax call per piece of motion.
        progress: Called at intervals with the completed fraction.

    Returns:
        A trajectory. If it did not reach t1, its `result` gives the reason.

    Raises:
        ValueError: The state is not finite or a gap is negative, t1 < t0, a setting is
            out of range or given twice, or a function of the system has the wrong
            shape.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
        >>> print(trajectory)
        BouncingBall from 0 to 1 s, impacts: 1, contacts: 0
    """
    settings = _chosen(settings, tolerance, solver, max_step)
    _check_choices(engine, derivatives)
    t0, t1 = jnp.asarray(t0, dtype=jnp.float64), jnp.asarray(t1, dtype=jnp.float64)
    system, settings = _SYSTEM.of(system), _SETTINGS.of(settings)
    traced = is_traced((system, state, t0, t1, settings))
    if state is None:
        state, t_start = _released(system, t0, traced)
    else:
        state, t_start = real_array(state), t0
    if not traced:
        check_arguments(system, settings, t_start, state, t1)
    if engine == "diffeqsolve":
        parts, code = _by_diffeqsolve(
            system, settings, t_start, state, t1, max_steps, progress, traced
        )
        return _trajectory(system, settings, t0, t1, parts, code)
    if _USABLE.get(settings) is None:
        tableau_of(settings.solver)
        _USABLE.keep(settings, True)
    if traced or derivatives == "reverse":
        rows = 4096 if max_steps is None else max_steps
        # a scan is differentiated in reverse mode step by step, a loop only as a whole
        forward = _forward if settings.plain else whole(_forward)
        of_rows: Callable[..., tuple[Parts, Any]] = (
            _reversible if derivatives == "reverse" else forward
        )
        parts, code = of_rows(system, settings, t_start, state, t1, rows)
        if traced:
            return _trajectory(system, settings, t0, t1, parts, code)
    else:
        budget = 1_000_000 if max_steps is None else max_steps
        log, mode, code = run_untraced(
            system, settings, t_start, state, t1, budget, progress
        )
        parts = _assemble(system, t_start, state, mode, log, settings.compiles)
    if int(code) in (BEHIND, NOT_FINITE):
        # the loop returns only the code; the error states the value of the gap
        check_gaps(system, settings, t_start, state)
    return _trajectory(system, settings, t0, t1, _trim(parts), code)


def _by_diffeqsolve(
    system, settings, t0, state, t1, max_steps, progress, traced
) -> tuple[Parts, Any]:
    """Return the parts and the result code of a run by diffrax, piece by piece."""
    if isinstance(system, SwitchedSystem):
        raise ValueError(
            'engine="diffeqsolve" does not support switching surfaces; use '
            'engine="loop"'
        )
    if traced:
        raise ValueError(
            'engine="diffeqsolve" is driven from Python and cannot be traced by jit, '
            'vmap or grad; use engine="loop" there'
        )
    check_gaps(system, settings, t0, state)
    budget = 1_000_000 if max_steps is None else max_steps
    log, contact, code = simulate_segments(
        system, settings, t0, state, t1, budget, progress
    )
    return _trim(_assemble(system, t0, state, contact, log)), code


def _trajectory(system, settings, t0, t1, parts: Parts, code) -> Trajectory:
    impacts, contacts, steps, switches = parts
    return Trajectory(
        system, settings, t0, t1, impacts, contacts, steps, code, switches
    )


def _chosen(settings, tolerance, solver, max_step) -> Settings:
    """Return the settings of a run, given as `Settings` or as single arguments."""
    given = {"tolerance": tolerance, "solver": solver, "max_step": max_step}
    given = {name: value for name, value in given.items() if value is not None}
    if settings is None:
        return Settings(**given)
    if given:
        name = next(iter(given))
        raise ValueError(
            f"{name} and settings are both given; pass Settings({name}=...)"
        )
    return settings


def _released(system, t0, traced):
    """Return the state and time of the last release before t0."""
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
            "there is no contact in the period, and therefore no release point; pass "
            "the state to start from"
        )
    return state, time


def _constraints(system, t0) -> int:
    state = jax.ShapeDtypeStruct((2,), jnp.float64)
    gap = jax.eval_shape(system.gap, t0, state)
    return gap.shape[0] if gap.shape else 1


@program
def _release_point(system, t0):
    """Return the state and time of the last release, and whether there is none; the
    state is then NaN.
    """
    point = release_point(system, t0)
    nowhere = point.holds == 2
    return jnp.where(nowhere, jnp.nan, point.state), point.time, nowhere


def _forward(
    system, settings, t0, state, t1, rows: int
) -> tuple[Parts, Int[Array, ""]]:
    """Return the parts and the result code of a run with arrays of fixed lengths."""
    return _of_rows(run, system, settings, t0, state, t1, rows)


def _reversible(system, settings, t0, state, t1, rows: int):
    """Return the same as `_forward`, from a scan instead of a loop."""
    return _of_rows(run_reversible, system, settings, t0, state, t1, rows)


def _of_rows(runner, system, settings, t0, state, t1, rows):
    functions, plan, carried = prepare(system, settings, t0, state, t1, True)
    mode = carried.flags
    # with an invalid start, all states are NaN
    valid = (carried.status == RUNNING) | (carried.status == PAINLEVE)
    state = jnp.where(valid, state, jnp.nan)
    carried, log = runner(functions, plan, carried, rows)
    return assemble(system, t0, state, mode, log, (rows, rows)), _code(carried)


def _assemble(system, t0, state, mode, log: Log, compiles: bool = False) -> Parts:
    """Return the parts of a trajectory from the log of a run that is not traced."""
    t0, state, mode, log = jax.tree.map(np.asarray, (t0, state, mode, log))
    system = prepared(system)
    taken = log.kind > 0
    if not taken.all():
        log = Log(*(part[taken] for part in log))
    return assemble(system, t0, state, mode, log, None, np, compiles=compiles)


@jax.jit
def _code(carried: LoopState):
    """Return the index into `RESULTS`: `RUNNING` if the run has used up its steps."""
    return carried.status.astype(jnp.int32)


def _trim(parts: Parts) -> Parts:
    def cut(part):
        number = int(part.count)
        # in numpy, because jax would compile a slice for every new length; the slice is
        # copied, because a view would keep the entire log in memory
        return jax.tree.map(
            lambda a: np.asarray(a)[:number].copy() if a.ndim else a, part
        )

    known = [part for part in parts if part is not None]
    impacts, contacts, steps, *rest = jax.device_put([cut(part) for part in known])
    return Parts(
        _as(Impacts, impacts),
        _as(Contacts, contacts),
        _as(Steps, steps),
        _as(Switches, rest[0]) if rest else None,
    )


def _as(kind, part):
    assert isinstance(part, kind)
    return part
