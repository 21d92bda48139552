"""From an orbit to the problem whose solutions it is one of."""

from typing import Any

import numpy as np
from jaxtyping import ArrayLike, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid._system import with_array_parameters
from variational import Orbit

from ._periodic_orbit import periodic_orbit
from ._periodic_sticking import on_release
from ._problem import Start
from ._shooting import ImpactingOrbits
from ._signature import steps_for


def periodic_orbits(
    system: HybridSystem,
    orbit: Orbit | Float[ArrayLike, " n"] | None = None,
    period: float | int | None = None,
    *,
    beyond: bool = False,
) -> Start:
    """The family of periodic orbits that an orbit belongs to, and where it is on it.

    The problem is chosen by the motion: [`continuation.ImpactingOrbits`][] with the
    impacts that the orbit has, or [`continuation.StickingOrbits`][] where it sticks.

    **Arguments:**

    - `orbit`: from [`continuation.periodic_orbit`][]; or a guess of its state, or None,
      with `period`, as taken there.

    - `beyond`: for an orbit that sticks, whether to go on behind the interruption of
      its chattering with the orbits that have finitely many impacts.

    **Returns:** a [`continuation.Start`][], for [`continuation.follow`][].

    **Raises:** `ValueError` as `periodic_orbit`; and for an orbit that sticks without
    forcing.
    """
    system = with_array_parameters(system)
    if not isinstance(orbit, Orbit):
        orbit = periodic_orbit(system, orbit, period)
    base = None if system.period is None else float(system.period)
    length = float(orbit.period)
    number = 0 if base is None else round(length / base)
    if orbit.sticks:
        if number == 0:
            raise ValueError(
                "this orbit sticks without forcing; only orbits that stick once in "
                "some forcing periods can be followed"
            )
        problem, state = on_release(system, number, beyond)
        return Start(problem, state)
    n = int(orbit.state.shape[0])
    m = int(orbit.impacts.count)
    if m == 0:
        return _without_impacts(system, orbit, number, n)
    times = np.asarray(orbit.impacts.time)[:m]
    after = np.asarray(orbit.impacts.after)[:m]
    hits = tuple(int(c) for c in np.asarray(orbit.impacts.constraint)[:m])
    rows = np.concatenate([times[:, None], after], axis=1)
    steps = steps_for(system, rows, np.append(times[1:], times[0] + length))
    if number:
        rows[:, 0] *= number / length
        rows[:, 0] -= np.floor(rows[0, 0] / number) * number
    else:
        rows[:, 0] = (times - times[0]) / length
        rows[0, 0] = length
    return Start(ImpactingOrbits(system, hits, number, n, steps), rows.ravel())


def _without_impacts(system, orbit: Orbit, number: int, n: int) -> Start:
    from ._periodic_orbit import fly

    length, time = float(orbit.period), float(orbit.time)
    if number == 0:
        raise ValueError("an orbit without forcing must hit something to be followed")
    row = np.append(time, np.asarray(orbit.state))
    steps = steps_for(system, row[None], np.array([time + length]))
    end = np.ceil(time / length - 1e-12) * length
    state = fly(system, time, orbit.state, end, steps)
    return Start(ImpactingOrbits(system, (), number, n, steps), np.asarray(state))


def start_of(system: Any, start: Any) -> Start:
    """`follow(system, orbit, ...)` in terms of a problem."""
    if isinstance(start, Start):
        return start
    if isinstance(start, Orbit) or start is None:
        return periodic_orbits(system, start)
    raise ValueError(
        "give the orbit to start from, found with continuation.periodic_orbit(system, "
        "guess, period), or None for the one that the motion settles on"
    )
