"""Move the start of the period of an orbit away from its impacts.

The state jumps at an impact, so an orbit cannot be followed while an impact passes
through the start of its period.
"""

from typing import Any

import numpy as np

from jaxcam.hybrid import simulate

from .._parameter import as_jax, with_leaf
from .._point import with_field


# an impact is close to the start if the time between them is less than this fraction of
# the duration of the orbit
_CLOSE = 0.01


def moved_start(problem: Any, leaf: int, z: np.ndarray, before: np.ndarray | None):
    """Return the problem with a later start of the period, the unknowns there, and
    their difference from those of the point before; None if no impact is close to the
    start.

    `problem` is a `SingleShooting` of a system with forcing.
    """
    run = _run(problem, leaf, z)
    if run is None:
        return None
    start, end = run[1:]
    run, length = run[0], end - start
    hits = (np.asarray(run.impacts.time)[: int(run.impacts.count)] - start) / length
    if not np.any(np.minimum(hits, 1 - hits) < _CLOSE):
        return None
    switches: Any = run.switches
    turned = np.asarray(switches.time)[: int(switches.count)]
    marks = np.sort(np.concatenate([[0.0, 1.0], hits, (turned - start) / length]))
    longest = int(np.argmax(np.diff(marks)))
    share = float(marks[longest : longest + 2].mean())
    later = share * problem.periods
    moved = with_field(problem, "shift", np.asarray(float(problem.shift) + later))
    there = _at(run, start + share * length, z)
    if before is None:
        return moved, there, None
    earlier = _run(problem, leaf, before)
    if earlier is None:
        return moved, there, None
    run, start, end = earlier
    return moved, there, there - _at(run, start + share * (end - start), before)


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
    run = simulate(system, z, start, end, settings=problem.settings)
    return (run, start, end) if run.successful else None


def _at(run, time: float, z: np.ndarray) -> np.ndarray:
    return np.append(np.asarray(run.at(np.array([time]))[0]), z[-1])
