"""Add or remove one impact of an orbit."""

import jax.numpy as jnp
import numpy as np

from variational.orbits import flown, Shooting


def without_impact(equations: Shooting, u, parameters, number: int):
    """Return the equations and the unknowns of the orbit without impact `number`."""
    hits, periods = equations.constraints, equations.periods
    rows = np.array(u).reshape(len(hits), -1)
    hits = hits[:number] + hits[number + 1 :]
    if hits:
        rows = _renumbered(periods, rows, number)
        return _with(equations, hits), rows.ravel()
    if periods == 0:
        raise ValueError(
            "an orbit without forcing must keep at least one impact; follow the orbit "
            "without impacts as a LimitCycle"
        )
    length = float(equations.period(jnp.asarray(u), parameters))
    start = rows[0, 0] / periods * length
    end = np.ceil(start / length) * length
    begin = jnp.asarray(start), jnp.asarray(rows[0, 1:])
    state = flown(parameters, *begin, jnp.asarray(end))
    return _with(equations, (), 2 * equations.steps), np.asarray(state)


def with_impact(
    equations: Shooting, u, parameters, flight: int, start, time: float, which: int
):
    """Return the equations and the unknowns with an additional impact on constraint
    `which`, at `time` (s) in flight number `flight`, which begins at the row `start`
    (time, state).
    """
    first = jnp.asarray(start[0]), jnp.asarray(start[1:])
    state = flown(parameters, *first, jnp.asarray(time))
    length = float(equations.period(jnp.asarray(u), parameters))
    row = np.concatenate([[time / length * max(equations.periods, 1)], state])
    hits = equations.constraints
    if not hits:
        return _with(equations, (which,)), row
    rows = np.array(u).reshape(len(hits), -1)
    rows = np.insert(rows, flight + 1, row, axis=0)
    hits = hits[: flight + 1] + (which,) + hits[flight + 1 :]
    return _with(equations, hits), rows.ravel()


def _with(equations: Shooting, constraints, steps: int | None = None) -> Shooting:
    """Return the same equations for impacts on these constraints."""
    steps = equations.steps if steps is None else steps
    return Shooting(constraints, equations.periods, equations.dimension, steps)


def _renumbered(periods, rows, number):
    """Return the rows without row `number`; without forcing, times are measured from
    the first remaining row.
    """
    if periods or number:
        return np.delete(rows, number, axis=0)
    period, later = rows[0, 0], rows[1:].copy()
    later[:, 0] -= later[0, 0]
    later[0, 0] = period
    return later
