"""The exact motion of a piecewise-linear system, from event to event.

The rules are those of the documentation. A motion that arrives at a surface on which it
can slide begins to slide if the term needed to hold it there is at most its (static)
limit, and crosses otherwise; it leaves where that term exceeds the limit. An impact
reverses the normal velocity with its coefficient of restitution. Impacts that
accumulate are followed one by one until their speed is below 1e-12; then the constraint
is closed.
"""

import itertools
from typing import NamedTuple

import numpy as np

from ._switching_linear import Law, law, Linear, Mode
from ._switching_search import first_fall, Grid


# impacts slower than this close their constraint
_CLOSED = 1e-12
# a velocity below this is zero after an event that stops it
_STOPPED = 1e-13
_MOST_EVENTS = 4000
# this many successive events at surfaces, each this soon after the last, accumulate
_CROWD, _SHORT = 30, 1e-4
CROSSES, SLIDES, LEAVES, HITS, CLOSES, OPENS = range(6)


class Event(NamedTuple):
    """An event: its kind, its surface or constraint, and the state after it."""

    time: float
    kind: int
    which: int
    state: np.ndarray
    # normal velocity before an impact
    speed: float = 0.0


class Noise(NamedTuple):
    """Random changes of the state."""

    rng: np.random.Generator
    size: float


class Exact(NamedTuple):
    """A motion up to the time at which it is known."""

    events: list[Event]
    end: float
    final: np.ndarray
    # why it is not known further, or an empty string
    reason: str


class Programs:
    """The laws and grids of the modes of one system, computed once."""

    def __init__(self, system: Linear):
        self.system, self.known = system, {}

    def grid(self, mode: Mode) -> Grid:
        """The grid of a mode."""
        if mode not in self.known:
            self.known[mode] = Grid(law(self.system, mode))
        return self.known[mode]

    def law(self, mode: Mode) -> Law:
        """The law of a mode."""
        return self.grid(mode).law


def motion(
    programs: Programs, state, span: float, noise: Noise | None = None, ends=False
) -> Exact:
    """The motion from a state at time 0.

    With `noise`, the state is moved at random after the start and after each event,
    within the surfaces on which the motion is. With `ends`, the
    motion is not followed beyond impacts that accumulate.
    """
    loop = _Loop(programs, np.array(state, float), noise, ends)
    while loop.t < span and not loop.reason:
        loop.advance(span)
    return Exact(loop.events, min(loop.t, span), loop.x, loop.reason)


class _Loop:
    """The event loop."""

    def __init__(self, programs: Programs, x, noise, ends):
        self.programs, self.system = programs, programs.system
        self.t, self.x, self.noise, self.ends = 0.0, x, noise, ends
        self.events, self.reason = [], ""
        # surfaces and gaps that are zero: number of zero coefficients of each guard
        self.zeros: dict[tuple[str, int], int] = {}
        self.crowd = 0
        k, m = len(self.system.rows), len(self.system.gaps)
        self.mode = Mode((1,) * k, (False,) * k, (False,) * m)
        z = self.z
        heights = self.system.rows @ z
        self.mode = self.mode._replace(
            sides=tuple(1 if h >= 0 else -1 for h in heights),
            contact=self._resting(z),
        )
        near = np.flatnonzero(np.abs(heights) < _STOPPED)
        touched = [int(i) for i in near if self.system.width[i] == 0]
        if len(touched) > 1:
            self._begin(touched)
        elif touched:
            self._arrive(touched[0], started=True)

    @property
    def z(self):
        return self.system.extended(self.x, self.t)

    def _resting(self, z) -> tuple[bool, ...]:
        """The constraints that are in contact at the start."""
        gaps, speeds = self.system.gaps @ z, self.system.speed_rows() @ z
        near = (np.abs(gaps) < _STOPPED) & (np.abs(speeds) < _STOPPED)
        return tuple(bool(b) for b in near)

    def advance(self, span):
        """Advance to the next event or to the end."""
        grid = self.programs.grid(self.mode)
        names = grid.law.names
        zeros = {
            names.index(key): self._order(grid.law, names.index(key), order)
            for key, order in self.zeros.items()
            if key in names
        }
        shaken = None if self.noise is None else self._shaken
        fall = first_fall(grid, self.z, zeros, span - self.t, shaken)
        last, self.t = self.t, self.t + fall.after
        self.x = fall.z[: len(self.x)]
        if fall.guard < 0:
            self.t = span
            return
        if fall.after > 0:
            self.zeros = {}
        self._handle(*names[fall.guard])
        quick = self.t - last < _SHORT and self.events[-1].kind < HITS
        self.crowd = self.crowd + 1 if quick else 0
        if self.crowd > _CROWD or len(self.events) > _MOST_EVENTS:
            self.reason = "events accumulate"

    def _order(self, rules: Law, guard: int, order: int) -> int:
        """Number of zero Taylor coefficients of a guard, after simultaneous events."""
        rate = rules.guards[guard] @ rules.matrix @ self.z
        return 1 if order == 2 and abs(rate) > 1e-9 else order

    def _shaken(self, z):
        """Move z at random, but not off the surfaces on which the motion is."""
        n, system = len(self.x), self.system
        z = z.copy()
        z[:n] += self.noise.size * self.noise.rng.normal(size=n)
        speeds = system.speed_rows()
        held = [system.gaps[j] for j, on in enumerate(self.mode.contact) if on]
        held += [speeds[j] for j, on in enumerate(self.mode.contact) if on]
        held += [system.rows[k] for k, on in enumerate(self.mode.sliding) if on]
        if held:
            rows = np.array(held)
            z[:n] -= np.linalg.pinv(rows[:, :n]) @ (rows @ z)
        return z

    def _handle(self, name: str, k: int):
        if name == "side":
            self._arrive(k)
        elif name in ("upper", "lower"):
            self._leave(k, 1 if name == "upper" else -1)
        elif name == "gap":
            self._impact(k)
        else:
            contact = _changed(self.mode.contact, k, False)
            self.mode = self.mode._replace(contact=contact)
            self.zeros["gap", k] = 3
            self._log(OPENS, k)
            if self.system.rubs and self.mode.sliding[0]:
                # without contact, no friction holds the slip
                self._stop()
            self._recheck()

    def _log(self, kind, k, speed=0.0):
        self.events.append(Event(self.t, kind, k, self.x.copy(), speed))

    def _arrive(self, k: int, started=False):
        """Slide along the surface that the motion has reached, or cross it.

        If it is `started` on the surface, it continues on the side that it enters.
        """
        mode, system = self.mode, self.system
        if self._can_slide(k):
            held = mode._replace(sliding=_changed(mode.sliding, k, True))
            rules = self.programs.law(held)
            z = self._projected(k)
            if abs(rules.needed[k] @ z) <= rules.limit[k] @ z:
                self.mode, self.x = held, z[: len(self.x)]
                self._log(SLIDES, k)
                self._recheck()
                return
        side = self._entered(k) if started else -mode.sides[k]
        self.mode = mode._replace(sides=_changed(mode.sides, k, side))
        if system.width[k] == 0:
            self.zeros["side", k] = 1
        if not started:
            self._log(CROSSES, k)
        self._recheck()

    def _begin(self, touched: list[int]):
        """Slide from the start on as many of the touched surfaces as possible.

        From the others, the motion enters one of the sides. If it can do so in several
        ways, it is not unique.
        """
        able = [k for k in touched if self._can_slide(k)]
        for number in range(len(able), -1, -1):
            found = []
            for held in itertools.combinations(able, number):
                others = [k for k in touched if k not in held]
                for signs in itertools.product((1, -1), repeat=len(others)):
                    mode = self.mode
                    for k in held:
                        sliding = _changed(mode.sliding, k, True)
                        mode = mode._replace(sliding=sliding)
                    for k, side in zip(others, signs, strict=True):
                        mode = mode._replace(sides=_changed(mode.sides, k, side))
                    if self._possible(mode, held, others):
                        found.append((mode, held, others))
            if found:
                break
        if len(found) != 1:
            self.reason = "several motions from the start"
            return
        ((self.mode, held, others),) = found
        for k in held:
            self.x = self._projected(k)[: len(self.x)]
            self._log(SLIDES, k)
        for k in others:
            self.zeros["side", k] = 1

    def _possible(self, mode: Mode, held, others) -> bool:
        """Whether the motion can slide on `held` and enter the sides of `others`."""
        rules, z, rows = self.programs.law(mode), self.z, self.system.rows
        holds = all(abs(rules.needed[k] @ z) <= rules.limit[k] @ z for k in held)
        rates = [mode.sides[k] * (rows[k] @ rules.matrix @ z) for k in others]
        return holds and all(rate > 0 for rate in rates)

    def _can_slide(self, k: int) -> bool:
        system = self.system
        if not system.slidable[k] or system.width[k] > 0:
            return False
        return not system.rubs or k > 0 or any(self.mode.contact)

    def _entered(self, k: int) -> int:
        """The side that the motion enters from the surface."""
        for side in (1, -1):
            one = self.mode._replace(sides=_changed(self.mode.sides, k, side))
            rate = self.system.rows[k] @ self.programs.law(one).matrix @ self.z
            if side * rate > 0:
                return side
        return self.mode.sides[k]

    def _projected(self, k: int):
        """z with the state moved onto surface k, along its direction."""
        z, kick = self.z, self.system.kicks[k]
        row = self.system.rows[k]
        z[: len(kick)] -= kick * (row @ z) / (row[: len(kick)] @ kick)
        return z

    def _leave(self, k: int, side: int):
        mode = self.mode
        sliding = _changed(mode.sliding, k, False)
        self.mode = Mode(_changed(mode.sides, k, side), sliding, mode.contact)
        self.zeros["side", k] = 1 if self.system.holding[k] > 1 else 2
        self._log(LEAVES, k)
        self._recheck()

    def _recheck(self):
        """End sliding on surfaces where the event has changed the needed term."""
        rules, z = self.programs.law(self.mode), self.z
        for k, on in enumerate(self.mode.sliding):
            if on and abs(rules.needed[k] @ z) > (1 + 1e-12) * rules.limit[k] @ z:
                self._leave(k, 1 if rules.needed[k] @ z > 0 else -1)
                return

    def _impact(self, j: int):
        system, n = self.system, len(self.x)
        row = system.speed_rows()[j]
        speed, r = row @ self.z, system.restitution[j]
        impulse = -(1 + r) * speed / (row[:n] @ system.normals[j])
        self.x = self.x + impulse * system.normals[j]
        stops = False
        if system.rubs:
            slip, most = system.rows[0] @ self.z, system.rubs * impulse
            gain = system.rows[0][:n] @ system.kicks[0]
            stops = abs(slip) <= most * abs(gain) or self.mode.sliding[0]
            part = -slip / gain if stops else most * self.mode.sides[0]
            self.x = self.x + part * system.kicks[0]
        self._log(HITS, j, speed)
        self._after_jump(stops)
        rules = self.programs.law(self.mode)
        pull = row @ rules.matrix @ self.z
        rebound = row @ self.z
        if rebound <= _CLOSED and pull < 0:
            self._close(j, stops)
        else:
            self.zeros["gap", j] = 2 if r == 0 else 1
            if self.ends and rebound < 1e-4:
                self.reason = "impacts accumulate"

    def _close(self, j: int, stops: bool):
        row, way, n = self.system.speed_rows()[j], self.system.normals[j], len(self.x)
        self.x = self.x - way * (row @ self.z) / (row[:n] @ way)
        self.mode = self.mode._replace(contact=_changed(self.mode.contact, j, True))
        self._log(CLOSES, j)
        if self.ends:
            self.reason = "in contact"
        if stops:
            self._stop()
        self._recheck()

    def _after_jump(self, stops: bool):
        """Update the sides after an impact, and end sliding where the impact moves the
        state off the surface.
        """
        heights = self.system.rows @ self.z
        sides, sliding = list(self.mode.sides), list(self.mode.sliding)
        for k, height in enumerate(heights):
            if abs(height) > _STOPPED and not self.system.width[k]:
                sides[k], sliding[k] = 1 if height > 0 else -1, False
        self.mode = Mode(tuple(sides), tuple(sliding), self.mode.contact)
        if stops:
            self._stop()
        self._recheck()

    def _stop(self):
        """Hold the slip that an impact has stopped, or let it begin again."""
        free = _changed(self.mode.sliding, 0, False)
        self.mode = self.mode._replace(sliding=free)
        self._arrive(0, started=True)


def _changed(flags: tuple, k: int, value) -> tuple:
    return (*flags[:k], value, *flags[k + 1 :])
