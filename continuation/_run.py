"""Follow a branch step by step."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ._begin import leave, solved_start
from ._closed import closed, Past
from ._context import Context
from ._joins import JOINS, joins
from ._near_grazing import (
    doubtful,
    ends,
    middle_of,
    passed_in_step,
    singular_after,
    singular_before,
)
from ._parameter import as_arguments, leaf_of
from ._passed import (
    around_corner,
    SHORT,
    special_here,
)
from ._point import Point, set_parameters, with_parameter
from ._program import evaluate
from ._restated import restated
from ._resume import resumed
from ._solution import (
    point_of,
    Solution,
    solution_after,
    solution_at,
    stations,
)
from ._step import attempt_step
from ._touch import hits_differ, touched
from .problem import AbstractProblem
from .special import ahead, Located
from .step_control import Refusal


# number of failed steps from one point before an end of the branch is sought just ahead
_HALVINGS = 2


class Run:
    """A run that follows a branch from point to point."""

    def __init__(self, context: Context, algorithm, name: str, direction: int):
        self.context = context
        self.algorithm = algorithm
        self.name = name
        self.direction = direction
        self.label = 0
        self.pending: list[Point] = []
        # special points at which the problem has changed
        self.changes: list[Point] = []
        self.past = Past(context.leaf)
        # the special point just passed, if no regular point follows it yet
        self.last: Solution | None = None

    # Beginning

    def begin(
        self,
        problem: AbstractProblem,
        start: Any,
        history=(),
        kind: str = "start",
        arclength: float = 0.0,
    ) -> Solution:
        """Return the first solution, and add its point to `pending`, unless the branch
        is resumed.
        """
        if isinstance(start, Point):
            self.label = start.label
            found = resumed(self.context, problem, start, history)
            current, self.past, self.changes = found
            return current
        p = start.parameter
        p = float(leaf_of(problem.parameters, self.context.leaf)) if p is None else p
        low, high = self.context.bounds
        if not low <= p <= high:
            raise ValueError(
                f"the branch starts at {self.name} = {p:g}, outside the bounds "
                f"({low:g}, {high:g}); widen them or start elsewhere"
            )
        z = np.append(np.asarray(start.state, float), p)
        problem = with_parameter(problem, self.context.leaf, p)
        problem = problem.refreshed(z[:-1], problem.parameters)
        context = self.context
        step = context.settings.step if start.step is None else start.step
        if start.kind:
            here = evaluate(problem, context, z, np.asarray(start.tangent))
            at_start = solution_at(problem, context.leaf, here, step, arclength)
            self.pending.append(self._point(at_start, start.kind, start.reason))
        while True:
            if start.tangent is not None:
                at, step = leave(problem, context, z, start.tangent, step)
            else:
                at = solved_start(problem, context, z, self.name, self.direction)
            reached = arclength
            if kind == "regular":
                reached += float(np.linalg.norm((at.z - z) / at.scale))
            current = solution_at(problem, context.leaf, at, step, reached)
            reason = "" if start.kind else start.reason
            point = self._point(current, kind, reason)
            refusal = current.problem.check(point)
            if refusal is None:
                break
            step /= 2
            if start.tangent is None or step < context.settings.min_step:
                raise ValueError(f"the start is not admissible: {refusal}")
            # the rejected point must not use up a label
            self.label -= 1
        if kind == "regular":
            # the special points between z and this point come before it
            self.label -= 1
            self._pass_first(problem, z, current)
            point = self._point(current, kind, reason)
        self.pending.append(point)
        self.past.add(problem, point)
        return self._with_fresh_references(current)._replace(yielded=True)

    def _pass_first(self, problem: AbstractProblem, z, following: Solution) -> None:
        """Add the folds and flips between z, at which a problem begins, and the first
        point of its branch to `pending`.
        """
        found = singular_after(self.context, problem, z, following)
        if found is not None:
            self.last, passed = found
            self._pass_events(self.last, following.at.z - z, passed)

    # Stepping

    def points(self, current: Solution) -> Iterator[Point]:
        """Yield the pending points, and then the points after `current`."""
        yield from self._flush()
        (low, high), p = self.context.bounds, current.at.z[-1]
        outwards = current.at.tangent[-1]
        if (p <= low and outwards < 0) or (p >= high and outwards > 0):
            yield self._end(current, f"the branch starts at a bound of {self.name}")
            return
        count = self.label
        while True:
            if count >= self.context.settings.max_points:
                yield self._end(
                    current, f"{count} points, as many as the settings allow"
                )
                return
            count += 1
            self.last = None
            following, reason = self._advance(current)
            yield from self._flush()
            if following is None:
                yield self._end(current, reason)
                return
            if reason:
                yield self._point(following, "end", reason)
                return
            if not following.yielded:
                point = self._point(following, "regular")
                self.past.add(following.problem, point)
                yield point
            current = self._with_fresh_references(following)

    def _advance(self, current: Solution) -> tuple[Solution | None, str]:
        """Return the next point, or None if the branch ends before it, and the reason
        why the branch ends (empty if it continues).
        """
        step, failures = current.step, 0
        while True:
            attempted = attempt_step(
                current.problem,
                self.context,
                self.algorithm,
                current.at,
                stations(current, self.algorithm.predictor.stations),
                step,
                self.name,
            )
            attempted = around_corner(self.context, current, attempted, step)
            refusal = attempted.refusal
            shortest = self.context.settings.min_step
            short = step <= max(SHORT * self.context.settings.step, 2 * shortest)
            leaps = hits_differ(current, attempted)
            if leaps and not short:
                # special points just before a grazing would be missed
                step /= 2
                continue
            last = step / 2 < shortest
            if short and (leaps or (attempted.at is None and (failures or last))):
                moved = restated(self.context, current, step)
                over = self._touch(current, step) if moved is None else (moved, "")
                if over is not None:
                    return over
            if attempted.at is not None:
                following = solution_after(
                    current, self.context.leaf, attempted.at, attempted.following
                )
                passed = passed_in_step(self.context, current, following)
                if doubtful(current.problem, passed) and not last:
                    # the step may have led to another branch
                    step /= 2
                    continue
                chord = following.at.z - current.at.z
                over = self._pass_events(current, chord, passed)
                if over is not None:
                    return over
                refusal = self._refusal(following)
                if not refusal:
                    back = closed(self.context, self.past, current, following)
                    if back is not None:
                        return back
                    return following, attempted.bound
            # a sharp bend is no sign of an end, and a failed long step need not be one
            failures += attempted.refusal is not Refusal.TURNED
            if failures > _HALVINGS or last:
                over = self._end_ahead(current, step)
                if over is not None:
                    return over
            if last:
                reason = f"the step was halved down to {step:.1e}, but {refusal}"
                if current.problem.may_touch:
                    reason += "; no grazing of a constraint was found ahead"
                return None, reason
            step /= 2

    def _with_fresh_references(self, current: Solution) -> Solution:
        problem = current.problem
        if type(problem).refreshed is AbstractProblem.refreshed:
            return current
        problem = with_parameter(problem, self.context.leaf, current.at.z[-1])
        fresh = problem.refreshed(current.at.z[:-1], problem.parameters)
        return current._replace(problem=fresh)

    # Special points

    def _pass_events(self, current: Solution, chord, passed: list[tuple[str, Located]]):
        """Add special points to `pending`; if one of them ends the problem or the
        branch, return the result of `_advance`, otherwise None.
        """
        for name, located in passed:
            special = special_here(self.context, current, chord, name, located)
            if special is None:
                continue
            stood = special.current
            point = self._add_special(
                stood,
                special.kind,
                located.reason,
                located.converged,
                special.coefficient,
                special.criticality,
            )
            if ends(current.problem, name):
                return self._transition(current, point, stood)
            if joins(current, point):
                return stood, JOINS
        return None

    def _add_special(self, stood: Solution, kind: str, *details) -> Point:
        """Add a special point to `pending`, and a regular one between it and another
        special point of the same problem just before it.
        """
        if self.last is not None:
            middle = middle_of(self.context, self.last, stood.at.z)
            if middle is not None:
                self.pending.append(self._point(middle, "regular"))
        point = self._point(stood, kind, *details)
        self.pending.append(point)
        self.last = stood
        return point

    def _end_ahead(self, current: Solution, step: float):
        """Search for a zero of an ending monitor just ahead of a failed step."""
        for name, monitor in current.problem.monitors().items():
            value = current.tests.get(name, np.nan)
            if not monitor.ends or not np.isfinite(value) or value == 0:
                continue
            located = ahead(
                current.problem, name, self.context, current.at, value, 2 * step
            )
            if located is None:
                continue
            chord = 1.001 * (located.z - current.at.z)
            passed = singular_before(self.context, current, located.z, chord) or []
            passed = [*passed, (name, located)]
            over = self._pass_events(current, chord, passed)
            if over is not None:
                return over
        return None

    def _touch(self, current: Solution, step: float):
        """Pass a grazing near a short step; None if there is none."""
        found = touched(self.context, current, step)
        if found is None:
            return None
        touch, stood = found
        chord = stood.at.z - current.at.z
        passed = singular_before(self.context, current, stood.at.z, chord) or []
        # folds and flips neither end the branch nor join another one
        self._pass_events(current, chord, passed)
        point = self._add_special(stood, "grazing", touch.reason)
        if touch.start.tangent is None:
            return None, "grazing ends the branch; no orbit was found beyond it"
        return self._transition(current, point, stood, touch.start)

    def _transition(self, current, point: Point, stood: Solution, beyond=None):
        """Return the first solution beyond a point, or None and why the run ends."""
        self.changes.append(point)
        self.direction = 1 if current.at.tangent[-1] >= 0 else -1
        reason = f"{point.kind} ends the branch"
        starts_of: tuple = (
            lambda: current.problem.accumulation(self.changes),
            lambda: current.problem.transition(point, stood.at),
        )
        if beyond is not None:
            starts_of = (lambda: beyond,)
        for start_of in starts_of:
            start = start_of()
            if start is None:
                continue
            given = as_arguments(start.problem.parameters, self.context.leaf)
            problem = set_parameters(start.problem, given)
            waiting, label = list(self.pending), self.label
            try:
                following = self.begin(
                    problem, start, kind="regular", arclength=point.arclength
                )
            except ValueError as error:
                self.pending, self.label = waiting, label
                reason = f"{point.kind} ends the branch; beyond it, {error}"
            else:
                return following, ""
        return None, reason

    # Points

    def _flush(self) -> Iterator[Point]:
        while self.pending:
            yield self.pending.pop(0)

    def _refusal(self, current: Solution) -> str:
        """Return why a point is not admissible; empty if it is admissible."""
        if type(current.problem).check is AbstractProblem.check:
            return ""
        point = self._point(current, "regular")
        # the point is only checked and must not use up a label
        self.label -= 1
        return current.problem.check(point) or ""

    def _end(self, current: Solution, reason: str) -> Point:
        return self._point(current, "end", reason)

    def _point(self, current: Solution, kind: str, *details) -> Point:
        self.label += 1
        return point_of(self.context, current, self.label, kind, *details)
