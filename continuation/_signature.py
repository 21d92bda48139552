"""The sequence of impacts of an orbit: read from its motion, and changed."""

from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import HybridSystem, Trajectory

from ._shooting_flight import flight_end, flight_nodes


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


#: numbers of steps to choose from, and the error allowed in a flight
_STEPS = (16, 32, 64, 128, 256)
_ALLOWED = 1e-12


@eqx.filter_jit
def _fly(system, t0, x0, t1, steps: int):
    return flight_end(system, t0, x0, t1, steps=steps)


@eqx.filter_jit
def _errors(system, starts, ends, steps: int):
    return jax.vmap(lambda a, b: flight_nodes(system, a[0], a[1:], b, steps)[2])(
        starts, ends
    )


def steps_for(system: HybridSystem, starts, ends) -> int:
    """How many steps each of these flights needs for an error of about 1e-12.

    **Arguments:** times and states `(m, 1 + n)` at the starts, times `(m,)` of the
    ends.

    **Raises:** `ValueError` where 256 steps are not enough.
    """
    starts, ends = jnp.asarray(starts), jnp.asarray(ends)
    for steps in _STEPS:
        wrong = float(np.max(np.asarray(_errors(system, starts, ends, steps))))
        if wrong < _ALLOWED:
            return steps
    if not wrong < 1e-9:
        raise ValueError(
            f"{_STEPS[-1]} steps of order eight leave an error of {wrong:.0e} in a "
            "flight; the vector field is stiff or not smooth there"
        )
    return _STEPS[-1]


def from_motion(
    system: HybridSystem, turn: Trajectory, periods: int
) -> tuple["ImpactingOrbits", np.ndarray]:
    """The problem of the orbit that one turn of the motion shows, and its state.

    **Arguments:**

    - `turn`: a run over one period of the orbit, near it.
    - `periods`: the number of forcing periods in it; 0 without forcing.

    **Raises:** `ValueError` where the motion sticks.
    """
    from ._shooting import ImpactingOrbits

    if int(turn.contacts.count):
        raise ValueError(
            "this motion sticks; follow it with StickingOrbits instead of "
            "ImpactingOrbits"
        )
    n = int(turn.steps.state.shape[1])
    m = int(turn.impacts.count)
    t0, t1 = float(turn.t0), float(turn.t1)
    if m == 0:
        if periods == 0:
            raise ValueError("this motion has no impacts; give a guess that hits")
        whole = -np.floor(-(t0 / (t1 - t0) - 1e-12)) * (t1 - t0)
        state = np.asarray(turn.at([min(max(whole, t0), t1)])[0])
        start = np.concatenate([[0.0], state])
        steps = steps_for(system, start[None], np.array([t1 - t0]))
        return ImpactingOrbits(system, (), periods, n, steps), state
    times = np.asarray(turn.impacts.time)[:m]
    after = np.asarray(turn.impacts.after)[:m]
    hits = tuple(int(c) for c in np.asarray(turn.impacts.constraint)[:m])
    length = t1 - t0
    ends = np.append(times[1:], times[0] + length)
    rows = np.concatenate([times[:, None], after], axis=1)
    steps = steps_for(system, rows, ends)
    if periods:
        rows[:, 0] *= periods / length
        rows[:, 0] -= np.floor(rows[0, 0] / periods) * periods
    else:
        rows[:, 0] = (times - times[0]) / length
        rows[0, 0] = length
    return ImpactingOrbits(system, hits, periods, n, steps), rows.ravel()


def without_impact(problem: "ImpactingOrbits", u, parameters, number: int):
    """The problem without impact `number`, and the state that leaves it out."""
    from ._shooting import ImpactingOrbits

    m, n = len(problem.constraints), problem.dimension
    hits = problem.constraints[:number] + problem.constraints[number + 1 :]
    rows = np.array(u).reshape(m, 1 + n)
    if hits:
        rows = _renumbered(problem, rows, number)
        return ImpactingOrbits(
            parameters, hits, problem.periods, n, problem.steps
        ), rows.ravel()
    if problem.periods == 0:
        raise ValueError("an orbit without forcing must keep at least one impact")
    length = float(problem.period(jnp.asarray(u), parameters))
    start = rows[0, 0] / problem.periods * length
    end = np.ceil(start / length) * length
    state = _fly(
        parameters,
        jnp.asarray(start),
        jnp.asarray(rows[0, 1:]),
        jnp.asarray(end),
        problem.steps,
    )
    empty = ImpactingOrbits(parameters, (), problem.periods, n, 2 * problem.steps)
    return empty, np.asarray(state)


def with_impact(
    problem: "ImpactingOrbits", u, parameters, flight: int, time: float, which: int
):
    """The problem with another impact, on `which`, at `time` (s) of a flight."""
    from ._shooting import ImpactingOrbits

    u = jnp.asarray(u)
    starts, _ = problem.flights(u, parameters)
    start = starts[flight]
    state = _fly(parameters, start[0], start[1:], jnp.asarray(time), problem.steps)
    length = float(problem.period(u, parameters))
    row = np.concatenate([[time / length * max(problem.periods, 1)], state])
    hits = (
        problem.constraints[: flight + 1] + (which,) + problem.constraints[flight + 1 :]
    )
    if not problem.constraints:
        return ImpactingOrbits(
            parameters, (which,), problem.periods, problem.dimension, problem.steps
        ), row
    rows = np.array(u).reshape(len(problem.constraints), -1)
    rows = np.insert(rows, flight + 1, row, axis=0)
    larger = ImpactingOrbits(
        parameters, hits, problem.periods, problem.dimension, problem.steps
    )
    return larger, rows.ravel()


def _renumbered(problem, rows, number):
    """Rows without one; without forcing time counts from the first that is left."""
    if problem.periods or number:
        return np.delete(rows, number, axis=0)
    period, later = rows[0, 0], rows[1:].copy()
    later[:, 0] -= later[0, 0]
    later[0, 0] = period
    return later
