"""Find the grazing of a constraint near an orbit, and the orbits beyond it.

At grazing, two branches of orbits meet: one with an impact whose speed tends to zero,
and one without it. Both are smooth curves of the equations in which the time of that
impact, or of the smallest gap, is an unknown.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import simulate
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import gaps

from .._context import Context
from .._parameter import as_jax, with_leaf
from .._program import correct
from .._touch import Touch
from ..problem import Start
from ._without_stop import equations_at, Window


REASON = (
    "the orbit touches {} and {} an impact; the multipliers have no limit here, see "
    "those of the neighbouring points"
)
# displacement for differences, relative to the scales of the unknowns
_NUDGE = 1e-6
# Newton corrections, and their size at convergence relative to the scales
_ITERATIONS, _CONVERGED = 15, 1e-9
# samples of a period between which the smallest gap is sought
_SAMPLES = 512
# longest interval without the constraint, as a fraction of a forcing period
_WIDEST = 0.1
# longest and shortest distance to the first orbit beyond, relative to the first step
# of a branch
_FIRST, _NEAREST = 1e-2, 1e-5


def touching(problem: Any, context: Context, at: Any, reach: float) -> Touch | None:
    """Return the nearest grazing within `reach` ahead of an orbit, or None.

    `problem` is a `SingleShooting`; `at` is a point of its branch; the distance is
    measured like the length of a step.
    """
    best, distance = None, reach
    for window, time in _windows(problem, context.leaf, at.z):
        curve = _Curve(problem, context, window, at.scale)
        row = curve.solved(np.append(at.z, time))
        if row is None:
            continue
        way = (row[:-1] - at.z) / at.scale
        low, high = context.bounds
        ahead = float(way @ (at.tangent / at.scale)) > 0 and low <= row[-2] <= high
        if ahead and np.linalg.norm(way) <= distance:
            best, distance = (window, row), float(np.linalg.norm(way))
    if best is None:
        return None
    window, row = best
    other = _Curve(problem, context, _struck(window, not window.strikes), at.scale)
    change = -1.0 if window.strikes else 1.0
    start = _beyond(other, row, float(at.observed["impacts"]) + change)
    name = problem.parameters.constraint_name(int(window.constraint))
    word = "loses" if window.strikes else "gains"
    return Touch(start, REASON.format(name, word))


@program
def _heights(system, times, states):
    return jax.vmap(lambda t, x: gaps(system, t, x))(times, states)


def _windows(problem, leaf: int, z) -> list[tuple[Window, float]]:
    """Return the slowest impact and the lowest gap of an orbit that may soon graze,
    each with its time as a fraction of the period.
    """
    system = as_jax(with_leaf(problem.parameters, leaf, z[-1]))
    u = jnp.asarray(z[:-1])
    start, end = (float(time) for time in problem.times(u, system))
    if not jax.eval_shape(lambda x: gaps(system, start, x), problem.state(u)).size:
        return []
    run = simulate(system, problem.state(u), start, end, settings=problem.settings)
    if not run.successful or int(run.contacts.count):
        return []
    shares = np.linspace(0.0, 1.0, _SAMPLES + 1)
    times = start + shares * (end - start)
    states = np.asarray(run.at(times))
    heights = np.asarray(_heights(system, times, states))
    count = int(run.impacts.count)
    hits = (np.asarray(run.impacts.time)[:count] - start) / (end - start)
    which = np.asarray(run.impacts.constraint)[:count]
    sizes = np.max(np.abs(heights), axis=0)
    found = []
    if count:
        speeds = np.abs(np.asarray(run.impacts.speed_before)[:count]) / sizes[which]
        slowest = int(np.argmin(speeds))
        found.append((int(which[slowest]), float(hits[slowest]), True))
    dips = [
        (float(heights[k, m] / sizes[m]), m, float(shares[k]))
        for m in range(heights.shape[1])
        for k in range(1, _SAMPLES)
        if heights[k, m] <= min(heights[k - 1, m], heights[k + 1, m])
        and not np.any((which == m) & (np.abs(hits - shares[k]) < 2 / _SAMPLES))
    ]
    if dips:
        _, m, share = min(dips)
        found.append((m, share, False))
    widest = _WIDEST / max(problem.periods, 1)
    windows = []
    for m, share, strikes in found:
        apart = np.abs(np.concatenate([[0.0, 1.0], hits]) - share)
        half = min(widest, float(np.min(apart[apart > 0])) / 2)
        values = (m, share - half, share + half, sizes[m], strikes)
        windows.append((Window(*map(np.asarray, values)), share))
    return windows


def _struck(window: Window, strikes: bool) -> Window:
    """Return the same window, with or without the impact."""
    w = window
    return Window(w.constraint, w.begin, w.end, w.lift, np.asarray(strikes))


class _Curve:
    """Orbits with or without the impact, near grazing."""

    def __init__(self, problem, context: Context, window: Window, scale):
        self.problem, self.context, self.window = problem, context, window
        self.scales = np.append(scale, float(window.end - window.begin))

    def values(self, rows) -> np.ndarray:
        return equations_at(self.problem, self.context.leaf, self.window, rows)

    def around(self, row) -> tuple[np.ndarray, np.ndarray]:
        """Return the equations and their scaled Jacobian."""
        moves = np.diag(_NUDGE * self.scales)
        found = self.values(np.concatenate([row + moves, row - moves, [row]]))
        n = row.size
        return found[-1], (found[:n] - found[n:-1]).T / (2 * _NUDGE)

    def solved(self, row, plane: np.ndarray | None = None) -> np.ndarray | None:
        """Return the grazing orbit near a row; with the covector of a `plane`, the
        orbit in it through the row; None if Newton's method fails.
        """
        first = row
        for _ in range(_ITERATIONS):
            value, matrix = self.around(row)
            if plane is not None:
                kept = self._kept()
                value = np.append(value[kept], plane @ ((row - first) / self.scales))
                matrix = np.concatenate([matrix[kept], plane[None]])
            if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(value))):
                return None
            sizes = np.linalg.norm(matrix, axis=1)
            try:
                step = np.linalg.solve(matrix / sizes[:, None], -value / sizes)
            except np.linalg.LinAlgError:
                return None
            row = row + step * self.scales
            if not self.window.begin < row[-1] < self.window.end:
                return None
            if np.max(np.abs(step)) < _CONVERGED:
                return row
        return None

    def direction(self, row) -> np.ndarray | None:
        """Return the unit scaled direction from the grazing orbit in which the gap
        opens or the impact gains speed.
        """
        _, matrix = self.around(row)
        if not np.all(np.isfinite(matrix)):
            return None
        kept = matrix[self._kept()]
        along = np.linalg.svd(kept / np.linalg.norm(kept, axis=1)[:, None])[2][-1]
        gap, velocity = matrix[-2:] @ along
        opens = velocity < 0 if self.window.strikes else gap > 0
        return along if opens else -along

    def _kept(self) -> list[int]:
        """Return the indices of the equations that hold along the curve."""
        n = self.scales.size
        return [*range(n - 2), n - 2 if self.window.strikes else n - 1]


def _beyond(curve: _Curve, row, impacts: float) -> Start:
    """Return the start of the branch beyond the grazing orbit `row`; without a step if
    there is no orbit with this number of impacts.
    """
    problem, context, scale = curve.problem, curve.context, curve.scales[:-1]
    problem = problem.beyond()
    z = row[:-1]
    along = curve.direction(row)
    step = _FIRST * context.settings.step
    while along is not None and step >= _NEAREST * context.settings.step:
        near = curve.solved(row + step * along * curve.scales, along)
        if near is not None:
            away = near[:-1] - z
            at = correct(problem, context, near[:-1], away / scale**2, away)
            if at.success and float(at.observed["impacts"]) == impacts:
                length = float(np.linalg.norm((at.z - z) / scale))
                return Start(problem, z[:-1], float(z[-1]), at.z - z, length)
        step /= 4
    return Start(problem, z[:-1], float(z[-1]))
