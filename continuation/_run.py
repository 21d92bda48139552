"""The walk along a branch."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ._begin import leave, settle
from ._closed import closed
from ._here import Here, point_of, stand
from ._locate import ahead, Located, Walk
from ._parameter import as_arrays, leaf_of
from ._passed import located_between, sign_changes, special_here
from ._point import Point, set_parameters, with_field, with_parameter
from ._predictors import Station
from ._problem import AbstractProblem
from ._program import Corrected, evaluate
from ._step import Attempt, StepControl


# failures in one place before an end is looked for just ahead
_HALVINGS = 2


class Run:
    """One walk along a branch."""

    def __init__(self, walk: Walk, algorithm, name: str, direction: int):
        self.walk = walk
        self.algorithm = algorithm
        self.name = name
        self.direction = direction
        self.control = StepControl(walk.settings)
        self.label = 0
        self.pending: list[Point] = []
        self.origin: Corrected | None = None

    # Beginning

    def begin(
        self, problem: AbstractProblem, start: Any, history=(), kind: str = "start"
    ) -> Here:
        """Stand at the first point, which is put into `pending` unless it is known."""
        if isinstance(start, Point):
            return self._resumed(problem, start, history)
        p = start.parameter
        p = float(leaf_of(problem.parameters, self.walk.leaf)) if p is None else p
        low, high = self.walk.bounds
        if not low <= p <= high:
            raise ValueError(
                f"the branch starts at {self.name} = {p:g}, outside the bounds "
                f"({low:g}, {high:g}); widen them or start elsewhere"
            )
        z = np.append(np.asarray(start.state, float), p)
        problem = with_parameter(problem, self.walk.leaf, p)
        problem = problem.refreshed(z[:-1], problem.parameters)
        if start.tangent is not None:
            at, step = leave(problem, self.walk, z, start)
        else:
            at = settle(problem, self.walk, z, self.name, self.direction)
            step = start.step
        step = self.walk.settings.step if step is None else step
        here = stand(problem, at, step, 0.0, ())
        point = self._point(here, kind, start.reason)
        refusal = here.problem.check(point)
        if refusal is not None:
            raise ValueError(f"the start is not admissible: {refusal}")
        self.pending.append(point)
        self.origin = at
        return self._with_fresh_references(here)._replace(told=True)

    def _resumed(self, problem: AbstractProblem, start: Point, history) -> Here:
        walk = self.walk
        z = np.append(start.state, start.parameter)
        problem = with_parameter(problem, walk.leaf, z[-1])
        problem = problem.refreshed(z[:-1], problem.parameters)
        at = evaluate(problem, walk.leaf, z, start.tangent, walk.width, walk.settings)
        # to the last digit what they were when the point was found
        at = with_field(at, "tangent", np.asarray(start.tangent))
        at = with_field(at, "scale", np.asarray(start.scale))
        passed = [p for p in history if not p.special and p.label < start.label]
        passed = [p for p in passed if p.signature == start.signature]
        trail = tuple((np.append(p.state, p.parameter), p.tangent) for p in passed)
        self.label = start.label
        here = stand(problem, at, start.step, start.arclength, trail)
        if passed and passed[0].label == 1:
            first = passed[0]
            self.origin = evaluate(
                problem, walk.leaf, np.append(first.state, first.parameter),
                first.tangent, walk.width, walk.settings,
            )  # fmt: skip
        elif start.label == 1:
            self.origin = at
        return here

    # Walking

    def points(self, here: Here) -> Iterator[Point]:
        """The points from here on."""
        yield from self._flush()
        low, high = self.walk.bounds
        outwards = here.at.tangent[-1]
        if (here.at.z[-1] <= low and outwards < 0) or (
            here.at.z[-1] >= high and outwards > 0
        ):
            yield self._end(here, f"the branch starts at a bound of {self.name}")
            return
        count = self.label
        while True:
            if count >= self.walk.settings.max_points:
                yield self._end(here, f"{count} points, as many as the settings allow")
                return
            count += 1
            there, reason = self._advance(here)
            yield from self._flush()
            if there is None:
                yield self._end(here, reason)
                return
            if reason:
                yield self._point(there, "end", reason)
                return
            if not there.told:
                yield self._point(there, "regular")
            here = self._with_fresh_references(there)

    def _advance(self, here: Here) -> tuple[Here | None, str]:
        """The next point, and why the branch ends with it; None: it ends before."""
        step, control, failures = here.step, self.control, 0
        while True:
            attempt = control.attempt(
                here.problem, self.walk, self.algorithm, here.at, self._stations(here),
                step, self.name,
            )  # fmt: skip
            refusal = attempt.refusal
            if not refusal:
                assert attempt.at is not None
                there = self._moved(here, attempt, step)
                names = sign_changes(self.walk, here, there)
                passed = located_between(self.walk, here, there, names)
                doubt = self._doubt(here, passed)
                if doubt and step / 2 >= self.walk.settings.min_step:
                    # the step may have led to another branch
                    step /= 2
                    continue
                over = self._pass_events(here, there, passed)
                if over is not None:
                    return over
                refusal = self._refusal(there)
                if not refusal:
                    back = closed(self.walk, self.origin, here, there)
                    if back is not None:
                        return back, "the branch is closed: back at its start"
                    return there, attempt.bound
            # a bend says nothing of an end, and long steps fail for other reasons
            last = step / 2 < self.walk.settings.min_step
            failures += attempt.angle == 0 or not attempt.refusal
            if failures > _HALVINGS or last:
                over = self._end_ahead(here, step)
                if over is not None:
                    return over
            if last:
                return None, (
                    f"the step was halved down to {step:.1e}, and still {refusal}"
                )
            step /= 2

    def _stations(self, here: Here) -> list[Station]:
        """The last points in the lengths of the current one."""
        scale = here.at.scale
        wanted = max(self.algorithm.predictor.stations, 1)
        trail = (*here.trail, (here.at.z, here.at.tangent))[-wanted:]
        return [
            Station(z / scale, v / scale / np.linalg.norm(v / scale)) for z, v in trail
        ]

    def _moved(self, here: Here, attempt: Attempt, step: float) -> Here:
        at = attempt.at
        assert at is not None
        length = float(np.linalg.norm((at.z - here.at.z) / here.at.scale))
        trail = (*here.trail, (here.at.z, here.at.tangent))[-8:]
        there = stand(
            here.problem,
            at,
            self.control.next_step(attempt, step),
            here.arclength + length,
            trail,
        )
        # a value of exactly zero keeps the sign, and changes it in the next step
        for name, value in there.tests.items():
            if value == 0:
                before = here.tests.get(name, 0.0)
                there.tests[name] = float(np.copysign(np.finfo(float).tiny, before))
        return there

    def _with_fresh_references(self, here: Here) -> Here:
        problem = here.problem
        if type(problem).refreshed is AbstractProblem.refreshed:
            return here
        problem = with_parameter(problem, self.walk.leaf, here.at.z[-1])
        fresh = problem.refreshed(here.at.z[:-1], problem.parameters)
        return here._replace(problem=fresh)

    # Special points

    def _doubt(self, here: Here, passed: list[tuple[str, Located]]) -> bool:
        """Whether the branch would end at a point that was not found."""
        return any(
            self._ends(here, name) and not located.converged for name, located in passed
        )

    def _pass_events(self, here: Here, there: Here, passed: list[tuple[str, Located]]):
        """Put special points into `pending`; how to go on where one ends it all."""
        chord = there.at.z - here.at.z
        for name, located in passed:
            point = self._special(here, chord, name, located)
            if point is None:
                continue
            self.pending.append(point)
            if self._ends(here, name):
                return self._transition(here, point)
        return None

    def _special(self, here: Here, chord, name: str, located: Located) -> Point | None:
        special = special_here(self.walk, here, chord, name, located)
        if special is None:
            return None
        return self._point(
            special.here,
            special.kind,
            located.reason,
            located.converged,
            special.coefficient,
            special.criticality,
        )

    @staticmethod
    def _ends(here: Here, name: str) -> bool:
        monitors = here.problem.monitors()
        return name in monitors and monitors[name].ends

    def _end_ahead(self, here: Here, step: float):
        """A zero of an ending monitor just ahead, where a step has failed."""
        for name, monitor in here.problem.monitors().items():
            value = here.tests.get(name, np.nan)
            if not monitor.ends or not np.isfinite(value) or value == 0:
                continue
            located = ahead(here.problem, name, self.walk, here.at, value, 2 * step)
            if located is None:
                continue
            chord = 1.001 * (located.z - here.at.z)
            point = self._special(here, chord, name, located)
            if point is not None:
                self.pending.append(point)
                return self._transition(here, point)
        return None

    def _transition(self, here: Here, point: Point):
        """Go on with another problem behind a point, or end there."""
        start = here.problem.transition(point)
        if start is None:
            return None, f"{point.kind} ends the branch"
        assert self.origin is not None
        origin, towards = self.origin, here.at.tangent[-1]
        self.direction = 1 if towards >= 0 else -1
        problem = set_parameters(
            start.problem, as_arrays(start.problem.parameters, self.walk.leaf)
        )
        try:
            there = self.begin(problem, start, kind="regular")
        except ValueError as error:
            return None, f"{point.kind} ends the branch; behind it, {error}"
        self.origin = origin if origin.z.shape == there.at.z.shape else there.at
        return there._replace(arclength=here.arclength), ""

    # Points

    def _flush(self) -> Iterator[Point]:
        while self.pending:
            yield self.pending.pop(0)

    def _refusal(self, here: Here) -> str:
        """Why a point is not admissible; empty if it is."""
        if type(here.problem).check is AbstractProblem.check:
            return ""
        point = self._point(here, "regular")
        # it is only judged, and gets no label
        self.label -= 1
        return here.problem.check(point) or ""

    def _end(self, here: Here, reason: str) -> Point:
        return self._point(here, "end", reason)

    def _point(self, here: Here, kind: str, *details) -> Point:
        self.label += 1
        return point_of(self.walk, here, self.label, kind, *details)
