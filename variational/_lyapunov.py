"""Compute Lyapunov exponents of a motion with impacts.

The event loop is differentiated one attempted step at a time, and a frame of tangent
vectors is orthonormalised after each step. If the LLVM backend lacks an operation, the
flow is differentiated period by period instead.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import HybridSystem, Settings, SwitchedSystem
from jaxcam.hybrid.backend import Lacking, say_lacking
from jaxcam.hybrid.batch import Horizon, Lanes
from jaxcam.hybrid.checks import check_system, refuse_tracers
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import check_restitution, restitutions
from jaxcam.parameters import as_arrays, pick, real_array, Where

from ._seen import Seen
from ._spectrum import LyapunovSpectrum, standard_error
from ._tangent_loop import frames_of_periods
from ._turn_frames import first_turn, next_turns


def lyapunov_spectrum(
    system: HybridSystem,
    state,
    turns: int = 500,
    *,
    t0: float = 0.0,
    transient: int = 100,
    turn: float | None = None,
    where: Where | None = None,
    values=None,
    settings: Settings | None = None,
    blocks: int = 16,
    max_steps: int = 10_000_000,
    progress: Callable[[float], None] | None = None,
) -> LyapunovSpectrum:
    """Compute all Lyapunov exponents of a motion with impacts by repeated
    orthonormalisation.

    Tangent vectors are propagated through all steps and events of the motion, and are
    orthonormalised repeatedly (Benettin et al., Meccanica 15, 1980; for impacts,
    Mueller, Chaos, Solitons and Fractals 5, 1995).

    Args:
        system: The system.
        state: Initial state, shape `(n,)`, or `(motions, n)` for many motions at once.
        turns: Number of periods to average over, after the transient.
        t0: Start time (s).
        transient: Number of initial periods excluded from the average.
        turn: Length of a period (s); default: the forcing period.
        where: Selects the parameter that differs between motions.
        values: Value of that parameter in each motion, shape `(motions,)`.
        settings: Accuracy of the simulation; the default tolerance is 1e-12.
        blocks: Number of blocks for the standard error (see `stderr` of the result).
        max_steps: Maximum number of attempted steps per motion, or per period with XLA.
        progress: Called with the fraction of periods completed.

    Returns:
        A `LyapunovSpectrum`; exponents are minus infinity if the motion sticks. With
            XLA, exponents are NaN if a tangent vector grows so much less than the
            others in one period that rounding hides its growth.

    Raises:
        ValueError: Shapes are inconsistent, there is no period, or a switching surface
            has hysteresis and the backend is XLA.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import lyapunov_spectrum
        >>> system = ImpactOscillator(3.5, wall=-0.2, damping=0.02)
        >>> found = lyapunov_spectrum(system, [-0.9, 0.0], turns=50, transient=20)
        >>> found.exponents.shape
        (2,)
    """
    inputs = system, state, values, t0, turn
    refuse_tracers("lyapunov_spectrum", "jax.jacfwd of jaxcam.hybrid.flow", *inputs)
    settings = Settings(tolerance=1e-12) if settings is None else settings
    settings.check()
    _check(system, turns, transient, turn, blocks, (where is None) == (values is None))
    system = as_arrays(system)
    settings = as_arrays(settings)
    state = real_array(state)
    single = state.ndim == 1 and values is None
    batched, shared, states = _lanes(system, state, where, values)
    length = None if turn is None else jnp.asarray(float(turn))
    begin = jnp.asarray(float(t0))
    returned = _restitutions(batched, shared, begin, states)
    check_restitution(system, returned[0] if single else returned)
    _check_system(batched, shared, begin, states, settings)
    told = (lambda _: None) if progress is None else progress

    def summary(seen, status, batched):
        return _summary(seen, status, _turn(batched, shared, length), transient, blocks)

    made = None
    if settings.compiles:
        chosen = None if where is None else pick(where, system)
        given = None if values is None else np.asarray(values, dtype=float)
        lanes = Lanes(system, chosen, given, np.asarray(states))
        when = Horizon(begin, length, transient + turns)
        try:
            *found, code = frames_of_periods(lanes, when, settings, max_steps, told)
            made = summary(Seen.of(*found), code, batched)
        except Lacking as lacking:
            say_lacking(lacking, settings.demands)
    if made is None:
        _refuse_hysteresis(system)
        given = shared, length, begin, settings, max_steps
        made = _by_xla(batched, states, given, transient + turns, told, summary)
    return jax.tree.map(lambda leaf: leaf[0], made) if single else made


def _by_xla(batched, states, given, turns: int, told: Callable, summary: Callable):
    """Return the summary from derivatives of the flow over each period, with XLA."""
    done = 0.0

    def some(batched, states):
        nonlocal done
        seen = Seen(states.shape[0], turns + 1, states.shape[1])

        def report():
            told(done + seen.share * states.shape[0] / padded)

        status = _by_turns(states, batched, *given, seen=seen, report=report)
        done += states.shape[0] / padded
        return summary(seen, status, batched)

    padded = _padded(states.shape[0])
    return _in_turn(some, batched, states)


def _check_system(batched, shared, t0, states, settings) -> None:
    """Raise `ValueError` if the system of the first motion is invalid."""
    if not len(states):
        raise ValueError("there are no motions; give at least one state")
    first = eqx.combine(jax.tree.map(lambda leaf: leaf[0], batched), shared)
    check_system(first, t0, states[0], settings)


def _check(system, turns: int, transient: int, turn, blocks: int, paired: bool) -> None:
    """Raise `ValueError` if the arguments do not fit together."""
    if turn is None and system.period is None:
        raise ValueError("this system has no forcing period; pass turn=... in seconds")
    if turn is not None and not turn > 0:
        raise ValueError(f"turn is {turn:g}; give a positive length of a period (s)")
    if transient < 0:
        raise ValueError(f"transient is {transient}; give 0 or more periods")
    if not 2 <= blocks <= turns:
        raise ValueError(
            f"{turns} periods cannot be divided into {blocks} blocks; give at least "
            "two blocks, and at least as many periods"
        )
    if not paired:
        raise ValueError(
            "give where and values together, with one value for each motion"
        )


def _refuse_hysteresis(system) -> None:
    if isinstance(system, SwitchedSystem) and system.remembers:
        raise ValueError(
            "lyapunov_spectrum supports hysteresis and modes only with the LLVM "
            "backend, because "
            "XLA differentiates period by period, and the state at the start of a "
            'period does not determine the side; use Settings(backend="llvm"), or '
            "differentiate jaxcam.hybrid.flow over the whole motion with jax.jacfwd"
        )


def _by_turns(
    states, batched, shared, length, begin, settings, max_steps, seen, report
):
    """Fill `seen` by differentiating the flow over each period; return a code for each
    motion.
    """
    carry = first_turn(states)
    while not seen.complete:
        carry, after = next_turns(
            batched, shared, length, begin, settings, max_steps, carry
        )
        seen.take_turns(*map(np.asarray, (after.logs, after.impacts, after.state)))
        report()
    return carry.code


def _padded(lanes: int) -> int:
    """Return the number of motions, padded so that all blocks have the same size."""
    count = -(-lanes // _BLOCK)
    return count * -(-lanes // count)


def _in_turn(some: Callable, batched, states):
    """Call `some(batched, states)` for one block of motions after another, and return
    the concatenated results.

    Blocks have equal sizes, so that one program suffices; they are padded with the last
    motion.
    """
    lanes = states.shape[0]
    count = -(-lanes // _BLOCK)
    if count == 1:
        return some(batched, states)
    size = _padded(lanes) // count
    order = np.minimum(np.arange(count * size), lanes - 1).reshape(count, size)
    parts = [
        some(jax.tree.map(lambda leaf, k=k: leaf[k], batched), states[k]) for k in order
    ]
    # a period of shape (1,) is common to all motions
    alike = parts[0].turn.shape[0] == 1
    whole = jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[:lanes], *parts)
    return eqx.tree_at(lambda m: m.turn, whole, parts[0].turn) if alike else whole


def _summary(seen: Seen, status, length, transient, blocks):
    length = np.asarray(length)
    with np.errstate(invalid="ignore"):
        # NaN, the difference of two infinities, where the motion stuck both before and
        # during a period
        local = np.diff(seen.logs[:, transient:], axis=1) / length[:, None, None]
    stuck = np.isneginf(seen.logs[:, transient + 1 :])
    local = np.where(stuck & np.isnan(local), -np.inf, local)
    turns = local.shape[1]
    error = standard_error(local, blocks)
    # if some vectors vanish, their order need not be that of their growth
    mean = local.mean(axis=1)
    order = np.argsort(-np.nan_to_num(mean, nan=-np.inf), axis=1, kind="stable")
    mean, error = (np.take_along_axis(a, order, axis=1) for a in (mean, error))
    local = np.take_along_axis(local, order[:, None], axis=2)
    impacts = seen.hits[:, -1] - seen.hits[:, transient]
    status = np.asarray(status).astype(int)
    return LyapunovSpectrum(
        exponents=jnp.asarray(mean),
        stderr=jnp.asarray(error),
        impact_rate=jnp.asarray(impacts / (turns * length)),
        local=jnp.asarray(local),
        state=jnp.asarray(seen.states),
        turn=jnp.asarray(length),
        code=jnp.asarray(status),
    )


def _lanes(system, state, where, values):
    """Return the parts of the system that differ between motions, the shared parts, and
    the initial state of each motion.
    """
    if where is None:
        return None, system, jnp.atleast_2d(state)
    values = jnp.asarray(values, dtype=jnp.float64)
    if values.ndim != 1:
        raise ValueError(f"values has shape {values.shape}; pass one for each motion")
    if state.ndim == 1:
        state = jnp.broadcast_to(state, (values.shape[0], state.shape[0]))
    if state.shape[0] != values.shape[0]:
        raise ValueError(
            f"there are {state.shape[0]} states and {values.shape[0]} values; give one "
            "of each for every motion"
        )
    one = pick(where, system)
    picked = one.replaced(jax.tree.map(lambda _: False, system), True)
    batched, shared = eqx.partition(one.replaced(system, values), picked)
    return batched, shared, state


# number of motions run together; all of them wait for the slowest one
_BLOCK = 128


@program
def _turn(batched, shared, length):
    """Return the length of a period in each motion, shape `(motions,)`, or `(1,)` if
    equal.
    """

    def one(batched):
        system = eqx.combine(batched, shared)
        return system.period * 1.0 if length is None else length

    if batched is None:
        return one(None)[None]
    return eqx.filter_vmap(one, in_axes=eqx.if_array(0))(batched)


@program
def _restitutions(batched, shared, t0, states):
    """Return the coefficients of restitution in each motion, shape `(motions, m)`."""

    def one(batched, state):
        return restitutions(eqx.combine(batched, shared), t0, state)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)
