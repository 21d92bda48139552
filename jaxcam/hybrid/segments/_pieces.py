"""Second engine: one `diffrax.diffeqsolve` call for each piece of motion.

A piece is a flight or a contact, up to the next event. The engine is written in plain
Python around a few compiled functions. It is slower than the loop but easier to follow,
and it supports implicit solvers. It also serves as a check of the loop, with which it
shares only the derivatives of the gap, the formula for the duration of chatter, and the
state in which bodies come to rest on several constraints.

diffrax checks the sign of an event function at the ends of its steps and locates the
event on an interpolant. A piece ends there at the latest; `_events.py` searches its
steps for earlier events.
"""

import jax
import jax.numpy as jnp
import numpy as np

from .. import breakpoints
from .._prepared import prepared
from ..codes import FINISHED, NOT_FINITE, RowKind, RUNNING, STEP_FAILED, TOGETHER
from ..loop import Log
from ..surface import may_hit_together
from ._end_of_chatter import end_of_chatter, Rebound, Rest
from ._events import Flown, TOO_LONG
from ._motion import CompiledMotion


# a flight with lambda = v |j| / a^2 below this takes one step instead of a diffrax call
_SHORT = 1e-3
# this many consecutive impacts, each while another gap is zero to within rounding,
# count as a joint accumulation
_MANY = 80


def simulate_segments(
    system, settings, t0, state, t1, max_steps, progress=None
) -> tuple[Log, jax.Array, jax.Array]:
    """Run from `t0` to `t1` (s) and log it as the loop does.

    **Arguments:** as in [`jaxcam.simulate`][jaxcam.hybrid.simulate], with concrete
    values.

    Returns:
        The log, the constraints in contact at the start `(m,)`, and the index into
            `RESULTS`.
    """
    engine = _Engine(system, settings, float(t0), np.asarray(state), float(t1))
    contact = engine.contact.copy()
    span = max(float(t1) - float(t0), 1e-300)
    while engine.code is None:
        if progress is not None:
            progress((engine.t - float(t0)) / span)
        if engine.t >= engine.t1:
            engine.code = FINISHED
        elif engine.steps >= max_steps:
            engine.code = RUNNING
        else:
            engine.advance()
    if progress is not None:
        progress(1.0)
    return engine.log(), jnp.asarray(contact), jnp.asarray(engine.code, jnp.int32)


class _Engine:
    """The state of a run; `contact` contains a flag for each constraint."""

    def __init__(self, system, settings, t0, state, t1):
        self.settings = settings
        self.motion = CompiledMotion(prepared(system), settings, np.ones_like(state))
        self.span = t1 - t0
        # breakpoints, which are passed between pieces, and their period
        own = system.period
        self.breaks = breakpoints.declared(system)
        self.repeat = np.inf if own is None else own
        self.t, self.x, self.t1 = t0, state, t1
        self._look_ahead(t0)
        jets = np.asarray(self.motion.jets(self.t, state))
        tiny = np.asarray(self.motion.start_room(self.t, state))
        touching = np.all(np.abs(jets[:, :2]) <= tiny.T, axis=1)
        self.contact = touching & (jets[:, 2] < 0)
        # origins of the components, and their largest excursions
        self.origin, self.extents = map(np.asarray, self.motion.extents(t0, state))
        period, longest = system.period, settings.max_step
        self.longest = self.span / 8 if period is None else float(period) / 8
        self.longest = min(self.longest, np.inf if longest is None else float(longest))
        # the first step of the next piece, shortened if it is too long
        self.first = np.inf
        self.fastest = 0.0
        # the constraint released at this instant, whose gap and velocity grow from zero
        self.released: int | None = None
        # consecutive impacts while another gap was closed to within rounding, but not
        # in contact
        self.crowded = 0
        self.steps = 0
        self.rows: list[tuple] = []
        self.code: float | None = None

    def advance(self):
        """Advance by one piece of motion, or by one event without duration."""
        if self.t >= self.end:
            self._pass_breakpoint()
            return
        _, level, rate = map(np.asarray, self._probe_here())
        if not np.all(np.isfinite([level, rate])):
            self.code = NOT_FINITE
            return
        for k in range(len(level)):
            if self.contact[k]:
                # rounding may put a start at a release on either side of the release
                wait = -level[k] / rate[k] if rate[k] < 0 else np.inf
                if level[k] < 0 or wait <= 1e-15 * (self.span + abs(self.t)):
                    self._release(k, self.t, self.x)
                    return
            elif level[k] <= 0 and rate[k] < 0 and k != self.released:
                self._impact(k, self.t, self.x)
                return
        jets = np.asarray(self.motion.jets(self.t, self.x))
        if not self._hop(jets):
            self._fly(jets, level, rate)

    def log(self) -> Log:
        """Return the rows, padded to a power of two so that few lengths are
        compiled.
        """
        n, m = len(self.x), len(self.contact)
        length = 64
        while length < len(self.rows):
            length *= 2
        table = np.zeros((length, 3 + 2 * n + m))
        for i, (kind, k, t, before, after, contact) in enumerate(self.rows):
            table[i] = [float(kind), float(k), t, *before, *after, *contact]
        columns = np.split(table, [1, 2, 3, 3 + n, 3 + 2 * n], axis=1)
        head = [jnp.asarray(c[:, 0]) for c in columns[:3]]
        return Log(*head, *map(jnp.asarray, columns[3:]))

    def _fly(self, jets, level, rate):
        """Integrate with one diffrax call, up to the next event if it is reached."""
        first = min(self.first, self.longest / 16)
        self._rescale(first)
        for k, jet in enumerate(jets):
            if not self.contact[k] and k != self.released:
                first = min(first, _time_to_contact(jet) / 4)
        piece = self.motion.fly(
            self.t, self.x, self.contact, self.end, first, self.longest
        )
        times, states, count, attempts, fired = map(np.asarray, piece)
        self.steps += int(attempts)
        points = int(count) - int(fired)
        if count < 2:
            bad = not np.all(np.isfinite(jets))
            self.code = NOT_FINITE if bad else self._no_step()
            return
        tiny = self._tiny(states[:count])
        flown = Flown(self.motion, self.contact, times, states, tiny)
        event = flown.first_event(int(count), bool(fired), level, rate, self.end)
        if event is TOO_LONG:
            self.first = first / 10
            if first <= 1e-16 * (self.span + abs(self.t)):
                self.code = self._no_step()
            return
        self.first = np.inf
        if event is not None:
            points = event.row + 1
        elif fired:
            # the interpolant was inaccurate: retry with shorter steps
            self.first = float(times[count - 1] - times[count - 2]) / 4
        if points > 1 or event is not None:
            self.released = None
        for i in range(1, points):
            self._row(RowKind.STEP, 0, times[i], states[i])
        if event is None:
            i = points - 1
            self.t, self.x = float(times[i]), states[i]
            if np.any(self.contact):
                self.x = flown.probe(i, 0.0).state
            if self.t >= self.t1:
                self.rows[-1] = (RowKind.STOP, *self.rows[-1][1:])
            return
        there = flown.probe(event.row, event.length)
        t = float(times[event.row]) + event.length
        if self.contact[event.constraint]:
            self._release(event.constraint, t, there.state)
        else:
            self._impact(event.constraint, t, there.state)

    def _hop(self, jets) -> bool:
        """Compute the next flight if it is too low to rise above rounding, and return
        whether that was done.

        The height of the flight follows from the integral of the normal velocity.
        """
        if not self.rows or self.rows[-1][0] != RowKind.IMPACT:
            return False
        k = int(self.rows[-1][1])
        _, u, a, j = jets[k]
        if np.any(self.contact) or not (a < 0 < u and u * abs(j) <= _SHORT * a * a):
            return False
        h = _time_to_contact((0.0, u, a, j))
        for _ in range(8):
            there = self.motion.hop(self.t, self.x, self.contact, h)
            change = float(there.climbed[k] / there.velocity[k])
            h = h - change
            if abs(change) <= 1e-15 * h:
                break
        there = self.motion.hop(self.t, self.x, self.contact, h)
        others = np.delete(np.asarray(there.level), k)
        near = np.delete(np.asarray(there.rate), k) * h
        if float(there.effort) > 1 or self.t + h > self.end:
            return False
        tiny = np.delete(self._tiny(self.x[None]), k)
        if np.any(others - 2 * np.abs(near) <= tiny):
            return False
        self.steps += 1
        self._impact(k, self.t + h, np.asarray(there.state))
        return True

    def _impact(self, k, t, before):
        """Apply the impact law, and complete the chatter if its conditions are met."""
        several, after = self._after_impact(k, t, before)
        speeds = [np.asarray(self.motion.velocity(t, x)) for x in (before, after)]
        self.fastest = max(self.fastest, float(speeds[1][k]))
        # an impact on one constraint may break contact with another
        reach = np.abs(before) + np.abs(after)
        rounding = np.asarray(self.motion.rounding(t, after, reach))[1]
        kept = np.abs(speeds[1] - speeds[0]) <= 500 * rounding
        self.contact = self.contact & kept
        self.t, self.x = t, after
        # an impact also counts as an attempt, so that every run ends
        self.steps += 1
        tiny = self._tiny(after[None])
        closed = np.asarray(self.motion.jets(t, after))[:, 0] <= tiny
        closed[k] = False
        self.crowded = self.crowded + 1 if np.any(closed & ~self.contact) else 0
        if self.crowded == _MANY:
            self.code = TOGETHER
        rebound = Rebound(t, after, k, self.contact, speeds, self.fastest)
        depth = float(self.settings.chatter_depth)
        rest = end_of_chatter(self.motion, rebound, depth, tiny, self.longest, several)
        if rest is not None and rest.time <= self.end:
            self._close(k, before, rest)
            return
        self._row(RowKind.IMPACT, k, t, after, before)

    def _after_impact(self, k, t, before):
        """Return whether several constraints are hit, and the state after impact."""
        if may_hit_together(self.motion.system, len(before), len(self.contact)):
            gaps = np.asarray(self.motion.jets(t, before))[:, 0]
            speeds = np.asarray(self.motion.velocity(t, before))
            slow = np.asarray(self.motion.rounding(t, before, np.abs(before)))[1]
            closed = (np.abs(gaps) <= self._tiny(before[None])) | self.contact
            closed[k] = True
            approach = closed & ~self.contact & (speeds < -500 * slow)
            approach[k] = True
            if np.sum(approach) > 1:
                joint = self.motion.impacts_together(t, before, closed)
                return True, np.asarray(joint)
        return False, np.asarray(self.motion.impact(t, before))[k]

    def _close(self, k, before, rest: Rest):
        """Log the last impact, on constraint `k`, and continue in contact."""
        self.contact = rest.contact
        self._row(RowKind.LAST_IMPACT, k, self.t, self.x, before)
        self.t, self.x = rest.time, rest.state
        self._row(RowKind.CONTACT, k, self.t, self.x)

    def _no_step(self) -> float:
        """Return the result code of a run in which no step is short enough."""
        return TOGETHER if self.crowded else STEP_FAILED

    def _release(self, k, t, x):
        self.contact = self.contact.copy()
        self.contact[k] = False
        self.released = k
        self.fastest = 0.0
        self.t, self.x = t, np.asarray(x)
        self._row(RowKind.RELEASE, k, self.t, self.x)

    def _row(self, kind, k, t, after, before=None):
        before = after if before is None else before
        for x in (before, after):
            self.extents = np.maximum(self.extents, np.abs(x - self.origin))
        self.rows.append((kind, k, float(t), before, after, self.contact))

    def _look_ahead(self, time):
        """Limit the next pieces to times between `time` (s) and the next breakpoint."""
        self.ahead, self.end = np.inf, self.t1
        if self.breaks:
            ahead = breakpoints.next_breakpoint(self.breaks, self.repeat, time)
            self.ahead = float(ahead)
            self.t = float(breakpoints.after(time, self.span))
            if self.ahead <= self.t1:
                self.end = float(breakpoints.before(self.ahead, self.span))

    def _pass_breakpoint(self):
        """Continue on the far side of a breakpoint, and log its exact time."""
        last, here, time = self.rows[-1] if self.rows else None, self.t, self.ahead
        self.x = self.x + (time - here) * self._rates()
        if last is not None and last[0] == RowKind.STEP and last[2] == here:
            kind = RowKind.STOP if time >= self.t1 else RowKind.STEP
            self.rows[-1] = (kind, last[1], time, self.x, self.x, last[-1])
        self.released = None
        self._look_ahead(time)
        self.x = self.x + (self.t - time) * self._rates()

    def _rates(self):
        return np.asarray(self.motion.rates(self.t, self.x, self.contact))

    def _rescale(self, first):
        """Scale errors by the distance that each component has moved, or will move in a
        step.
        """
        if self.settings.absolute is not None:
            size = np.maximum(np.abs(self.x), self.extents + np.abs(self.origin))
            wanted = np.asarray(self.settings.absolute) / float(self.settings.tolerance)
            self.motion = self.motion.measured(wanted + size)
            return
        scale = self.extents.copy()
        for length in (first, self.longest):
            if np.all(scale > 0):
                break
            there = np.asarray(
                self.motion.probe(self.t, self.x, self.contact, length).state
            )
            moved = np.where(np.isfinite(there), np.abs(there - self.x), 0.0)
            scale = np.where(scale > 0, scale, moved)
        if not np.all(scale > 0):
            # the rate that moves another component by its scale in the entire run
            slopes = np.asarray(self.motion.slopes(self.t, self.x, self.contact))
            seen = (slopes > 0) & (scale > 0)[:, None]
            most = np.where(
                seen, scale[:, None] / np.where(seen, slopes * self.span, 1.0), np.inf
            )
            least = most.min(axis=0)
            known = np.where(np.isfinite(least), least, 1.0)
            scale = np.where(scale > 0, scale, known)
        self.motion = self.motion.measured(scale)

    def _tiny(self, states):
        """Return the resolution of each gap, limited by rounding, for these states."""
        reach = np.abs(states).max(axis=0) + self.extents
        return 500 * np.asarray(self.motion.rounding(self.t, self.x, reach))[0]

    def _probe_here(self):
        return self.motion.probe(self.t, self.x, self.contact, 0.0)


def _time_to_contact(jet) -> float:
    """Return the smallest positive time at which the cubic through the jet is zero, or
    inf.
    """
    gap, velocity, acceleration, jerk = map(float, jet)
    cubic = [jerk / 6, acceleration / 2, velocity, gap]
    if velocity > 0 and abs(gap * acceleration) <= 1e-6 * velocity**2:
        # leaving the surface: the root at the start is known
        cubic = cubic[:3]
    roots = np.roots(cubic)
    times = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(times.min()) if times.size else np.inf
