"""Move the start of the period of an orbit away from its impacts and contacts.

The state jumps at an impact, and the number of independent state components changes at
the beginning and at the end of a contact. An orbit cannot be followed while such an
event, or a transition between named modes, passes through the start of its period.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import simulate, SwitchedSystem, Trajectory

from .._parameter import as_jax, with_leaf
from .._point import with_field


# an event is close to the start if the time between them is less than this fraction of
# the duration of the orbit
_CLOSE = 0.01


def moved_start(problem: Any, leaf: int, z: np.ndarray, before: np.ndarray | None):
    """Return the problem with a later start of the period, the unknowns there, and
    their difference from those of the point before; None if the start need not, or
    cannot, be moved.

    `problem` is a `SingleShooting` of a system with forcing.
    """
    found = _run(problem, leaf, z)
    if found is None:
        return None
    run, start, end = found
    length = end - start
    events = (_obstacles(run) - start) / length
    nearest = np.min(np.minimum(events, 1 - events), initial=1.0)
    if nearest >= _CLOSE:
        return None
    turned = (_first(run.switches, "time") - start) / length
    marks = np.sort(np.concatenate([[0.0, 1.0], events, turned]))
    middles, widths = (marks[:-1] + marks[1:]) / 2, np.diff(marks)
    share = next(
        (
            float(middles[k])
            for k in np.argsort(-widths)
            if widths[k] > 2 * nearest
            and _may_start(run, float(start + middles[k] * length))
        ),
        None,
    )
    if share is None:
        return None
    later = share * problem.periods
    moved = with_field(problem, "shift", np.asarray(float(problem.shift) + later))
    moved = with_field(moved, "held", ())
    there = _at(run, start + share * length, z)
    if before is None:
        return moved, there, None
    earlier = _run(problem, leaf, before)
    if earlier is None:
        return moved, there, None
    run, start, end = earlier
    return moved, there, there - _at(run, start + share * (end - start), before)


def with_held(problem: Any, u: np.ndarray):
    """Return the problem with the constraints with which the orbit is in contact at the
    start of its period.
    """
    found = _run(problem, None, u) if problem.periods else None
    if found is None:
        return problem
    (run, *_) = found
    held = np.flatnonzero(np.asarray(run.steps.contact)[0])
    return with_field(problem, "held", tuple(held.tolist()))


def _first(events: Any, name: str):
    """Return a column of a table of events, without empty rows; a system without
    switching surfaces has no table of them.
    """
    if events is None:
        return np.zeros(0)
    return np.asarray(getattr(events, name))[: int(events.count)]


def _obstacles(run: Trajectory) -> np.ndarray:
    """Return the times (s) of events that cannot pass through the start."""
    times = [_first(run.impacts, "time")]
    times += [_first(run.contacts, name) for name in ("start", "end")]
    system = run.system
    if isinstance(system, SwitchedSystem):
        which = _first(run.switches, "surface")
        times.append(_first(run.switches, "time")[which < system.one_way])
    return np.concatenate(times)


def _may_start(run: Trajectory, time: float) -> bool:
    """Return whether a simulation that starts at a time (s) is in the same mode as this
    one, and without contact.
    """
    steps = run.steps
    passed = np.asarray(steps.time)[: int(steps.count)]
    row = int(np.searchsorted(passed, time, side="right")) - 1
    if np.any(np.asarray(steps.contact)[row]):
        return False
    system = run.system
    if not (isinstance(system, SwitchedSystem) and system.remembers):
        return True
    state = run.at(np.array([time]))[0]
    sides = np.asarray(system.sides(time, state))
    present = np.asarray(steps.sides)[row]
    return bool(np.all((present == 0) | (present == sides)))


def sampled(problem: Any, observed: dict[str, Any], u: np.ndarray) -> dict[str, Any]:
    """Return the observed quantities with the states at the phase at which the branch
    began, once per forcing period.
    """
    found = _run(problem, None, u)
    if found is None:
        return observed
    run, start, end = found
    period = (end - start) / problem.periods
    first = start + (1 - float(problem.shift) % 1) * period
    times = first + period * np.arange(problem.periods)
    states = np.asarray(run.at(np.minimum(times, end)))
    # the first row remains the state at the phase and in the period of the first start
    turned = int(np.floor(float(problem.shift))) + 1
    states = np.roll(states, turned, axis=0)
    return observed | {"stroboscopic": states}


def _run(problem: Any, leaf: int | None, z: np.ndarray):
    """Return the simulation of one period with its start and end; None if it fails."""
    system = problem.parameters
    if leaf is not None:
        system, z = with_leaf(system, leaf, z[-1]), z[:-1]
    system = as_jax(system)
    start, end = (float(time) for time in problem.times(z, system))
    x = problem.start(jnp.asarray(z), system)
    run = simulate(system, x, start, end, settings=problem.settings)
    return (run, start, end) if run.successful else None


def _at(run, time: float, z: np.ndarray) -> np.ndarray:
    return np.append(np.asarray(run.at(np.array([time]))[0]), z[-1])
