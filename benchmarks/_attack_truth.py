"""Simulate impacts, contacts and releases with an independent event loop on DOP853.

It does not use jaxcam. Events are roots of the dense output of each step
(`_attack_search`), impact laws are applied to the state at the event, contact is
integrated with its contact forces, and sequences of impacts are followed one by one
(`_attack_rest`).
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853

from ._attack_dynamics import Dynamics
from ._attack_rest import follow, is_low
from ._attack_search import CLEAR, first_event
from ._attack_systems import Problem, settled


_MOST_EVENTS = 3000
# an impact slower than this cannot be distinguished from a graze
_GRAZE = 1e-6


class Impact(NamedTuple):
    """An impact: normal velocity before it, free normal acceleration after it."""

    time: float
    constraint: int
    velocity: float
    pull: float


class Truth(NamedTuple):
    """A motion, up to the time at which it is known."""

    impacts: list[Impact]
    # [start, end, constraint]; the end is infinite if contact lasts
    contacts: list[list]
    # (begin, end, dense output) of each piece
    pieces: list
    # (first, last) time of the sequences of impacts that end in contact, and their gaps
    sequences: list[tuple[float, float, frozenset]]
    # time up to which all this is known, and why it is not known further
    end: float
    reason: str
    # number of components of a state
    size: int

    def at(self, times) -> np.ndarray:
        """States at times up to `end`, after any impact there, shape `(k, 2 d)`."""
        times = np.asarray(times)
        if not times.size:
            return np.zeros((0, self.size))
        begins = np.array([piece[0] for piece in self.pieces])
        index = np.searchsorted(begins, times, side="right") - 1
        return np.array(
            [self.pieces[max(i, 0)][2](t) for i, t in zip(index, times, strict=True)]
        )


def motion(problem: Problem, state, begin: float, end: float, tolerance=1e-12) -> Truth:
    """The motion from a state; `begin` other than zero shifts the forcing."""
    loop = _Loop(problem, np.array(state), begin, tolerance)
    while loop.t < end and not loop.reason:
        loop.advance(end)
    return Truth(
        loop.impacts,
        loop.contacts,
        loop.pieces,
        loop.sequences,
        min(loop.t, end),
        loop.reason,
        len(loop.y),
    )


class _Loop:
    """The event loop, which advances from event to event."""

    def __init__(self, problem, y, t, tolerance):
        self.dynamics = Dynamics(problem)
        self.problem, self.tolerance = problem, tolerance
        self.t, self.y, self.reason = t, y, ""
        self.held: tuple[int, ...] = ()
        # gaps that have just left their surface, and those still near it
        self.fresh: set[int] = set()
        self.unarmed: set[int] = set()
        self.impacts, self.contacts, self.pieces = [], [], []
        self.sequences = []
        fastest = max(
            np.sqrt(np.max(np.linalg.eigvals(problem.stiffness).real, initial=0.0)),
            np.max(np.abs(problem.damping), initial=0.0),
            problem.frequency if np.any(problem.drive) else 0.0,
            np.max(problem.wall_frequency * (problem.wall > 0)),
            0.3,
        )
        self.longest = 0.3 / fastest
        if problem.resting:
            self._settle(problem.resting)
        elif np.min(gaps := self.dynamics.closing(t, y)[0]) < 1e-11:
            k = int(np.argmin(gaps))
            if self.dynamics.closing(t, y)[1][k] < 0:
                self._impact(k)
            else:
                self.fresh.add(k)

    def advance(self, end):
        """Advance to the next event or to the end."""
        if len(self.impacts) > _MOST_EVENTS:
            self.reason = "too many impacts"
            return
        dynamics, held = self.dynamics, self.held
        # a short force pulse is not stepped over: a step ends where it begins, and
        # steps are short while it acts
        p, limit, longest = self.problem, end, self.longest
        if p.kicked:
            first, last = (p.kick_time + s * 8 * p.kick_width for s in (-1, 1))
            limit = next((s for s in (first, last) if s > self.t), end)
            limit = min(limit, end)
            if first <= self.t < last:
                longest = min(longest, p.kick_width / 3)
        solver = DOP853(
            lambda t, y: dynamics.field(t, y, held),
            self.t,
            self.y,
            limit,
            rtol=self.tolerance,
            atol=self.tolerance / 10,
            max_step=longest,
        )
        while solver.status == "running":
            solver.step()
            if solver.status == "failed":
                self.reason = "integrator failed"
                return
            dense, a, b = solver.dense_output(), solver.t_old, solver.t
            blind = set(self.unarmed)
            if blind and not self._arm(dense, a, b):
                return
            fresh = self.fresh if a == self.t else set()
            event = first_event(dynamics, dense, a, b, held, fresh, blind)
            self.pieces.append((a, b if event is None else event.time, dense))
            if event is not None:
                self.t, self.y = event.time, dense(event.time)
                self.fresh = set()
                self._happen(event)
                return
        self.t, self.y, self.fresh = solver.t, solver.y, set()

    def _arm(self, dense, a, b):
        """Resume watching gaps that have opened; False if one closes too early."""
        gaps, speeds = self.dynamics.closing(b, dense(b))
        self.unarmed = {k for k in self.unarmed if gaps[k] < CLEAR}
        if any(speeds[k] < 0 or gaps[k] < -CLEAR for k in self.unarmed):
            self.t, self.reason = a, "renewed contact just after a release"
        return not self.reason

    def _happen(self, event):
        k = event.constraint
        if event.kind == "impact":
            self._impact(k)
            return
        self.held = tuple(row for row in self.held if row != k)
        self._close_contact(k)
        self.unarmed.add(k)
        if self.held:
            if np.min(self.dynamics.pressure(self.t, self.y, self.held)) <= 0:
                self.reason = "two releases at once"

    def _impact(self, k):
        """Process an impact, simultaneous impacts, and the rest of a sequence."""
        dynamics, t = self.dynamics, self.t
        gap, speeds = dynamics.closing(t, self.y)
        if speeds[k] > -_GRAZE:
            self.reason = "graze"
            return
        # the event has an error of the order of the tolerance: move the state onto the
        # surface
        self.y[: dynamics.d] -= dynamics.across[:, k] * gap[k] / dynamics.coupling[k, k]
        held, queue = set(self.held), [k]
        for count in range(500):
            if not queue:
                break
            hit = queue.pop(0)
            velocity = dynamics.closing(t, self.y)[1][hit]
            self.y = dynamics.struck(self.y, hit, velocity)
            pull = dynamics.jets(t, self.y, tuple(sorted(held)))[2][hit]
            self.impacts.append(Impact(t, hit, velocity, pull))
            speeds = dynamics.closing(t, self.y)[1]
            touching = held | set(self.fresh) | {k, hit}
            for row in touching - {hit}:
                if abs(speeds[row]) > 1e-11:
                    held.discard(row)
                if speeds[row] < -1e-11:
                    queue = [row]
            held.discard(hit)
            self.fresh = touching - held
        else:
            self.reason = "infinitely many impacts at one time"
            return
        if len(self.fresh) > 1 and count > 0:
            self.sequences.append((t, t, frozenset(self.fresh)))
        for row in set(self.held) - held:
            self._close_contact(row)
        self.held = tuple(sorted(held))
        self.unarmed -= {k}
        rebound = dynamics.closing(t, self.y)[1][k]
        if is_low(dynamics, t, self.y, k, rebound, self.held):
            self._follow(k, rebound)

    def _follow(self, k, rebound):
        begin = self.t
        rest = follow(self.dynamics, begin, self.y, k, rebound, self.held)
        self.impacts += [Impact(t, row, v, -1.0) for t, row, v in rest.impacts]
        if not rest.known:
            self.reason = "low impacts that do not end in contact"
            return
        self.t, self.y = rest.time, rest.state
        gone = set(self.held) - set(rest.held)
        for row in gone:
            self._close_contact(row)
        before = self.held
        self.held = ()
        self._settle(rest.held, before)
        self.pieces.append((begin, self.t, lambda _, y=self.y: y))
        self.sequences.append((begin, self.t, frozenset(rest.held)))

    def _settle(self, closed, already=()):
        """Decide which closed gaps with zero normal velocity stay in contact."""
        self.y = settled(self.problem, self.y, closed, self.t)
        held = self.dynamics.held_of(self.t, self.y, closed)
        if held is None:
            self.reason = "contact with neither compression nor release"
            return
        self.held, self.fresh = held, set()
        self.unarmed |= set(closed) - set(held)
        self.contacts += [[self.t, np.inf, k] for k in held if k not in already]

    def _close_contact(self, k):
        for contact in reversed(self.contacts):
            if contact[2] == k and contact[1] == np.inf:
                contact[1] = self.t
                return
