"""Find one periodic orbit from a guess, or from the steady-state motion."""

import warnings

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import (
    HybridSystem,
    RESULTS,
    Settings,
    simulate,
    stroboscope,
    SwitchedSystem,
)
from jaxcam.hybrid.checks import check_start
from jaxcam.hybrid.sizes import component_sizes
from jaxcam.hybrid.surface import gaps, rest_state
from jaxcam.parameters import as_arrays, real_array, VectorLike
from variational import Orbit, orbit_of
from variational.orbits import fixed_by_flow, flown, gap_sizes, refuse, seed, Shooting

from .._program import solve
from .._settings import BranchSettings
from ._shooting import ImpactingOrbits


_TURNS, _LOOKED = 400, 64
"""Number of periods after which transients should have decayed, and of periods examined
after that.
"""
_SAME = 1e-7
"""Two motions are equal if they differ by less than this, relative to their size."""
_SAME_TIME = 1e-9
"""Two times are equal if they differ by less than this fraction of the period."""
_CLOSED = 1e-9
"""A gap below this, relative to its size, counts as closed."""


def periodic_orbit(
    system: HybridSystem,
    guess: VectorLike | None = None,
    period: float | None = None,
    *,
    periods: int | None = None,
    t0: float = 0.0,
    settings: Settings | None = None,
) -> Orbit:
    """Find a stable or unstable periodic orbit with any number of impacts from a guess.

    The impacts of the motion from the guess define the equations of multiple shooting.
    If these cannot be solved, if the motion sticks, or if the system has switching
    surfaces, Newton's method is applied to the map over one period instead. Finally,
    the orbit is simulated; the simulation must return to the initial state.

    Args:
        system: A [`jaxcam.hybrid.HybridSystem`][], with or without forcing.
        guess: State at `t0`, shape `(n,)`. By default, the state on a stable orbit that
            is reached after several hundred forcing periods.
        period: Period of the orbit (s); for a system without forcing, an initial guess.
        periods: Period of the orbit in forcing periods, instead of `period`. The
            default is 1; without a guess, the number is detected.
        t0: Time of the guess (s).
        settings: Accuracy of the simulations; the default tolerance is 1e-12.

    Returns:
        A [`variational.Orbit`][] with `.state` at `.time` (`t0`, unless that is the
            time of an impact), `.period` (s), `.impacts`, `.contacts` and
            `.multipliers`.

    Raises:
        ValueError: The period is not a multiple of the forcing period, the motion does
            not converge to a periodic orbit, or no orbit is found near the guess; the
            message gives the reason.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> int(orbit.impacts.count)
        1
    """
    settings = Settings(tolerance=1e-12) if settings is None else settings
    system = as_arrays(system)
    system.check()
    base = None if system.period is None else float(system.period)
    number = _periods(base, period, periods)
    if guess is None:
        free = period is None and periods is None
        guess, number = _settled(system, base, number, free, t0)
    guess = real_array(guess, "guess")
    check_start(system, settings, jnp.asarray(float(t0)), guess, jnp.asarray(float(t0)))
    length = float(period) if base is None else number * base  # pyright: ignore
    orbit, why = None, "single shooting is used with switching surfaces"
    if not isinstance(system, SwitchedSystem):
        orbit, why = _by_shooting(system, guess, length, number, t0, settings)
    if orbit is None:
        orbit, later = _by_flow(system, guess, length, number, t0, settings)
        if orbit is None:
            raise ValueError(
                f"no periodic orbit of period {length:g} s was found near the guess: "
                f"{why}; Newton's method on the period map: {later}. Try a guess "
                "closer to the orbit, such as a simulated state, or another period"
            )
    return orbit


def _periods(base: float | None, period, periods) -> int:
    """Return the number of forcing periods; 0 without forcing."""
    if base is not None and isinstance(period, int | np.integer):
        warnings.warn(
            f"period={period} is interpreted as forcing periods; write "
            f"periods={period}, or period={period}.0 for seconds",
            stacklevel=3,
        )
        period, periods = None, period
    if periods is not None:
        return _counted(base, period, periods)
    if period is not None and not (np.ndim(period) == 0 and float(period) > 0):
        raise ValueError(f"period is {period}; give a positive number of seconds")
    if base is None:
        if period is None:
            raise ValueError(
                "this system has no forcing period; give a guess of the orbit's period "
                "in seconds"
            )
        return 0
    if period is None:
        return 1
    number = round(float(period) / base)
    if number < 1 or abs(float(period) / base - number) > 1e-6 * number:
        raise ValueError(
            f"period is {float(period):g} s, which is {float(period) / base:.6g} "
            f"forcing periods of {base:g} s, but must be a whole number of them; give "
            "that number as `periods`"
        )
    return number


def _counted(base: float | None, period, periods) -> int:
    """Return the given number of forcing periods, if it is valid."""
    if base is None:
        raise ValueError(
            "this system has no forcing; give a guess of the orbit's period in "
            "seconds, as `period`"
        )
    if period is not None:
        raise ValueError("give period (s) or periods (of the forcing), not both")
    if not isinstance(periods, int | np.integer) or periods < 1:
        raise ValueError(f"periods is {periods!r}; give a whole number, at least 1")
    return int(periods)


def _settled(system, base, number: int, free: bool, t0):
    """Return the state after many forcing periods, and the period counted in them."""
    if base is None:
        raise ValueError(
            "a system without forcing needs an initial guess; give a guess of the state"
        )
    start = _somewhere(system, t0)
    run = stroboscope(system, start, _TURNS + _LOOKED, t0=float(t0))
    states = run.states[0, _TURNS:]
    if run.code[0] or not np.all(np.isfinite(states)):
        first = ", ".join(f"{x:.4g}" for x in np.ravel(start))
        why = f": {RESULTS[int(run.code[0])]}" if run.code[0] else "."
        raise ValueError(
            "the simulation that should converge to an orbit stopped early; give a "
            f"guess of the state. It started at ({first}){why}"
        )
    when = float(t0) + (_TURNS + _LOOKED) * base
    moved = np.asarray(component_sizes(system, when, states[-1], base))
    size = np.maximum(np.max(np.abs(np.vstack([start, states])), axis=0), moved)
    for n in range(1, _LOOKED // 2 + 1) if free else (number,):
        if np.all(np.abs(states[n:] - states[:-n]) <= _SAME * size):
            return states[-1], n
    sought = f"up to {_LOOKED // 2}" if free else f"{number}"
    raise ValueError(
        f"after {_TURNS} forcing periods, the motion has not converged to an orbit "
        f"with a period of {sought} of them: it is chaotic, converges slowly, or has "
        "another period. Give a guess of the state, or other parameter values"
    )


def _somewhere(system, t0):
    """Return a state without penetration: the release point if it exists."""
    names = system.state_names
    n = len(names) or _dimension(system)
    try:
        run = simulate(system, None, t0, float(t0) + 1e-9 * float(system.period))
        return np.asarray(run.at([float(t0)])[0])
    except ValueError:
        pass
    state = rest_state(system, t0, n)
    if state is None:
        raise ValueError("no state with gap >= 0 was found; give a guess")
    return state


def _dimension(system) -> int:
    """Return the number of states of a system without state names."""
    for n in range(1, 65):
        try:
            shape = jax.eval_shape(
                system.vector_field, jnp.zeros(()), jnp.zeros(n)
            ).shape
        except (ValueError, IndexError, TypeError):
            continue
        if shape == (n,):
            return n
    raise ValueError("the number of states is not known; give a guess of the state")


def _by_shooting(system, guess, length, number, t0, settings):
    """Return the orbit with the impacts of the guessed motion, or None and a reason."""
    turn = simulate(system, guess, t0, float(t0) + length, settings=settings)
    if not bool(turn.successful):
        return None, turn.result
    if int(turn.contacts.count):
        # contact removes all memory of the past: either the next period is the orbit,
        # or no orbit is near
        state = turn.final
        for _ in range(3):
            orbit, why = _confirmed(system, state, float(t0), length, settings)
            if orbit is not None:
                return orbit, None
            turn = simulate(system, state, t0, float(t0) + length, settings=settings)
            state = turn.final
        return None, f"the motion from the guess sticks, and {why}"
    start, count, why = float(t0), int(turn.impacts.count), None
    if not count or not _touches(system, guess, start, length):
        orbit, why = _with_impacts_of(system, turn, number, start, settings)
        if orbit is not None:
            return orbit, None
    # an impact at the ends of the period would be counted twice or not at all, so
    # begin within a flight
    if not count:
        turn = simulate(system, guess, t0, start + 2 * length, settings=settings)
        if not bool(turn.successful) or not int(turn.impacts.count):
            return None, why
    start += (float(turn.impacts.time[0]) - start) / 2
    between = turn.at([start])[0]
    turn = simulate(system, between, start, start + length, settings=settings)
    if not bool(turn.successful):
        return None, turn.result
    return _with_impacts_of(system, turn, number, float(t0), settings)


def _with_impacts_of(system, turn, number, t0, settings):
    """Return the orbit with the impacts of the simulated period `turn`, or None and the
    reason for failure.
    """
    try:
        equations, u = seed(system, turn, number)
    except ValueError as error:
        return None, str(error)
    problem = ImpactingOrbits.of(system, equations)
    u, success, _ = solve(problem, u, BranchSettings(tolerance=1e-11))
    if not success:
        return None, (
            f"Newton's method on the {len(problem.constraints)} impacts of the motion "
            "from the guess did not converge"
        )
    why = refuse(equations, u, system)
    if why is not None:
        return None, f"the limit of the iteration is not an orbit: {why}"
    state, time, length = _at(equations, u, system, t0)
    return _confirmed(system, state, time, length, settings)


def _touches(system, state, t0, length) -> bool:
    """Return whether any gap is closed in this state, to within rounding."""
    t0 = jnp.asarray(t0)
    sizes = gap_sizes(system, t0, state, jnp.asarray(length))
    return bool(jnp.any(gaps(system, t0, state) <= _CLOSED * sizes))


def _by_flow(system, guess, length, number, t0, settings):
    """Return the orbit from Newton's method on the period map, or None and a reason."""
    guess, held = _held(system, guess, length, t0, settings)
    given = system, guess, length, t0, settings
    found = fixed_by_flow(*given, free=number == 0, held=held)
    if found is None:
        return None, "it did not converge"
    state, period = found
    return _confirmed(system, state, float(t0), period, settings)


def _held(system, guess, length, t0, settings):
    """Return the guess, or the state one period later, and the constraints that are
    then in contact, if the motion is in contact at all times from there on; otherwise
    the guess and no constraints.
    """
    state = guess
    for _ in range(2 if system.period is not None else 0):
        run = simulate(system, state, t0, float(t0) + length, settings=settings)
        rests = np.asarray(run.steps.contact)[: int(run.steps.count)]
        if not bool(run.successful) or not rests[-1].any():
            break
        if rests.any(axis=1).all():
            return state, tuple(np.flatnonzero(rests[0]).tolist())
        state = run.final
    return guess, ()


def _at(equations: Shooting, u, system, t0):
    """Return the state of an orbit at `t0` (without forcing, in the first flight), the
    time and the period.
    """
    u = jnp.asarray(u)
    starts, ends = map(np.asarray, equations.flights(u, system))
    length = float(equations.period(u, system))
    if equations.periods == 0:
        t0 = starts[0, 0] + (ends[0] - starts[0, 0]) / 2
    # the latest start of a flight at or before t0, shifted by whole periods
    same = _SAME_TIME * length
    ago = np.mod(t0 + same - starts[:, 0], length) - same
    last = int(np.argmin(ago))
    begin = starts[last, 0]
    if ago[last] < same:
        # t0 is the time of an impact: use the middle of the next flight instead
        time = begin + (ends[last] - begin) / 2
        t0 = t0 + (time - begin)
    else:
        time = begin + ago[last]
    x = flown(system, *map(jnp.asarray, (begin, starts[last, 1:], time)))
    return x, float(t0), length


def _confirmed(system, state, time, length, settings):
    """Return the orbit through a state, after checking that the event loop returns to
    it.
    """
    try:
        return orbit_of(system, state, length, time, settings=settings), None
    except ValueError as error:
        return None, str(error)
