"""Approach speeds at the impacts of a fit, from its fitted flights."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...hybrid.programs import program
from ...hybrid.surface import gaps
from ._discrete_states import discrete_ends
from ._ends import ends_of
from ._layout import Layout
from ._linearise import Point, with_begins
from ._model import DriveState
from ._modes import on_side_of
from ._pieces import IMPACT, Pieces
from ._problem import Problem
from ._starts import state_size


# An impact belongs to a flight that ends within this many samples of its recorded time
_NEAR = 2.0


def approach_speeds(problem: Problem, point: Point) -> list[Float[np.ndarray, " k"]]:
    """Return the approach speeds of the impacts of each recording.

    They are those of the fitted flights, which are more accurate than those of local
    fits to the samples, `impacts.approach`; only an impact after a flight with too few
    samples for a fit keeps that value.
    """
    value, rate, acceleration = map(
        np.asarray, _closing(problem.layout, problem.pieces, point)
    )
    # the speed at the impact, if the gap does not vanish at its recorded time
    squared = rate**2 - 2 * acceleration * value
    speed = np.sqrt(np.maximum(squared, 0.0))
    pieces, found = problem.pieces, []
    count = pieces.steps
    for row, part in enumerate(problem.segments):
        speeds = part.impacts.approach.copy()
        joint, exists = (np.asarray(x[row]) for x in (pieces.joint, pieces.exists))
        before = np.flatnonzero((joint[1:] == IMPACT) & exists[1:] & exists[:-1])
        flown = pieces.flown
        ends = np.asarray(flown.start[row]) + count * np.asarray(flown.step[row])
        for piece in before if part.impacts.count else ():
            away = np.abs(part.impacts.time - ends[piece])
            number = int(np.argmin(away))
            fitted = speed[row, piece, part.impacts.side[number]]
            if away[number] < _NEAR * part.recording.interval and fitted > 0:
                speeds[number] = fitted
        found.append(speeds)
    return found


@program
def _closing(layout: Layout, pieces: Pieces, point: Point):
    """Return all gaps at the end of each piece of flight, and their first and second
    derivatives, shape `(r, k, m)` each.
    """
    substeps = jnp.max(pieces.substeps)

    def one(values, states, pieces):
        model = layout.at(values)
        size, part = state_size(model), pieces.flown
        ends, discrete = ends_of(model, pieces, states, substeps), None
        if pieces.begins is not None:
            discrete = discrete_ends(model, pieces, states).last
        times = part.start + part.step * part.place.shape[-2]

        def derivatives(t, x, drive, step, discrete):
            system = model.during(t - step / 2, drive)(t)
            system = on_side_of(system, t, x, discrete)

            def along(function):
                def rate(t, x):
                    moved = jnp.ones_like(t), system.vector_field(t, x)
                    return jax.jvp(function, (t, x), moved)[1]

                return rate

            def gap(t, x):
                return gaps(system, t, x)

            rate = along(gap)
            return gap(t, x), rate(t, x), along(rate)(t, x)

        # in the middle of the last step
        last = DriveState(*(part[:, -1] for part in pieces.drive))
        return jax.vmap(derivatives)(times, ends[:, :size], last, part.step, discrete)

    return jax.vmap(one)(point.values, point.states, with_begins(pieces, point))
