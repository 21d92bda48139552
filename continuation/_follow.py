"""Following a branch, point by point."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ._algorithms import AbstractAlgorithm, PseudoArclength
from ._locate import ahead, locate, Located, pair_is_complex, Walk
from ._normal_forms import normal_form
from ._parameter import as_arrays, leaf_of, pick
from ._point import Point, set_parameters, with_field, with_parameter
from ._predictors import Station
from ._problem import AbstractProblem, Start
from ._program import correct, Corrected, evaluate
from ._settings import Settings
from ._stated import stated
from ._step import Attempt, StepControl
from ._test_functions import (
    BRANCH_POINT,
    eigenvalues_of,
    is_stable,
    test_values,
)


def follow(
    problem: AbstractProblem,
    start: Any,
    where: Callable[[Any], Any],
    bounds: tuple[float, float],
    algorithm: AbstractAlgorithm | None = None,
    *,
    settings: Settings | None = None,
    direction: int = 1,
    history: Sequence[Point] = (),
) -> Iterator[Point]:
    """Follow a branch of solutions; yields its points, special points among them.

    **Arguments:**

    - `problem`: what is followed, such as [`continuation.Equilibrium`][].
    - `start`: a state (n,), on the branch at the parameter that the problem has, or so
      near that Newton's method gets there; or a [`continuation.Start`][], such as a
      branch to switch to; or a [`continuation.Point`][], to go on from there exactly as
      the run that it is from did.
    - `where`: picks the parameter, as in `lambda parameters: parameters.speed`.
    - `bounds`: (lowest, highest) value of the parameter; the branch ends exactly there.
    - `algorithm`: [`continuation.PseudoArclength`][] by default.
    - `settings`: accuracy and steps.
    - `direction`: 1 to begin towards larger parameters, -1 towards smaller ones.
    - `history`: the points before `start`, where that is a point; predictors through
      several points need them.

    The branch ends on a bound, where it closes, where a monitor of the problem ends it
    and the problem knows no transition, where the smallest step fails, or after
    `settings.max_points`; the last point says which in `reason`.

    **Raises:** `ValueError` for a start that is no solution, a parameter that does not
    exist, bounds that are the wrong way round or do not contain the start.
    """
    settings = Settings() if settings is None else settings
    algorithm = PseudoArclength() if algorithm is None else algorithm
    begun, at = _begun(*stated(problem, start))
    leaf, name = pick(where, begun.parameters)
    begun = set_parameters(begun, as_arrays(begun.parameters, leaf))
    low, high = checked_bounds(bounds, name)
    if direction not in (1, -1):
        raise ValueError(f"direction is {direction!r}; give 1 or -1")
    walk = Walk(leaf, high - low, (low, high), settings)
    run = _Run(walk, algorithm, name, direction)
    # the first point is computed now, so that bad input is reported here
    first = run.begin(begun, at, history)
    return run.points(first)


def checked_bounds(bounds: tuple[float, float], name: str) -> tuple[float, float]:
    """Bounds as floats, or a `ValueError` that says what is wrong with them."""
    try:
        low, high = (float(x) for x in bounds)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"bounds of {name} must be two numbers, (lowest, highest)"
        ) from error
    if not (np.isfinite(low) and np.isfinite(high)):
        raise ValueError(f"bounds of {name} must be finite, not ({low:g}, {high:g})")
    if low >= high:
        raise ValueError(
            f"bounds ({low:g}, {high:g}) of {name} are the wrong way round; give "
            "(lowest, highest)"
        )
    return low, high


def _begun(problem: AbstractProblem, start: Any) -> tuple[AbstractProblem, Any]:
    """The problem to begin with, and where."""
    if isinstance(start, Start):
        return start.problem, start
    if isinstance(start, Point):
        if start.signature != problem.signature:
            problem = problem.with_signature(start.signature)
        return problem, start
    state = np.asarray(start, float)
    if state.ndim == 0:
        state = state[None]
    if state.ndim != 1 or not np.all(np.isfinite(state)):
        raise ValueError("start must be a state of shape (n,) of finite numbers")
    return problem, Start(problem, state)


class _Here(NamedTuple):
    """The point that the walk stands at."""

    problem: AbstractProblem
    at: Corrected
    tests: dict[str, float]
    step: float
    arclength: float
    #: points passed, oldest first, as states with their tangents
    trail: tuple
    #: whether its point has been handed out
    told: bool = False


class _Run:
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
    ) -> _Here:
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
            at, step = self._leave(problem, z, start)
        else:
            at, step = self._settle(problem, z), start.step
        step = self.walk.settings.step if step is None else step
        here = self._here(problem, at, step, 0.0, ())
        point = self._point(here, kind)
        refusal = here.problem.check(point)
        if refusal is not None:
            raise ValueError(f"the start is not admissible: {refusal}")
        self.pending.append(point)
        self.origin = at
        return self._with_fresh_references(here)._replace(told=True)

    def _settle(self, problem: AbstractProblem, z: np.ndarray) -> Corrected:
        """Solve at the parameter of the start, and find the direction there."""
        across = np.zeros_like(z)
        across[-1] = 1.0
        walk = self.walk
        at = correct(problem, walk.leaf, z, across, across, walk.width, walk.settings)
        if not at.success:
            # more iterations are another program: compiled only where they are needed
            patient = with_field(walk.settings, "max_iterations", 30)
            at = correct(problem, walk.leaf, z, across, across, walk.width, patient)
        if not at.success:
            # Newton has no answer where the derivative is singular; the start may
            # still be one
            given = evaluate(problem, walk.leaf, z, across, walk.width)
            size = np.abs(_residual(problem, z, walk.leaf)) / given.scale[:-1]
            if not np.all(size <= walk.settings.tolerance):
                raise ValueError(
                    f"the start is no solution at {self.name} = {z[-1]:g}, and "
                    "Newton's method finds none near it; start from a better guess "
                    f"(largest residual {_largest(size)})"
                )
            at = given
        return self._oriented(problem, at)

    def _oriented(self, problem: AbstractProblem, at: Corrected) -> Corrected:
        """The same point with its tangent in the direction asked for."""
        _, sizes, rows = np.linalg.svd(at.jacobian * at.scale[None, :])
        n = sizes.size
        null = rows[n:] if n == 0 else rows[np.append(sizes, 0) <= 1e-9 * sizes[0]]
        null = rows[-1:] if len(null) == 0 else null
        tangent = null.T @ null[:, -1]
        if np.linalg.norm(tangent) < 1e-9:
            tangent = null[-1] * (np.sign(null[-1].sum()) or 1.0)
        tangent = self.direction * tangent / np.linalg.norm(tangent)
        if len(null) == 1:
            return evaluate(
                problem, self.walk.leaf, at.z, tangent * at.scale, self.walk.width
            )
        at = with_field(at, "determinant", np.zeros(()))
        return with_field(at, "tangent", tangent * at.scale)

    def _leave(self, problem: AbstractProblem, z: np.ndarray, start: Start):
        """The first point of a branch that leaves z along a tangent."""
        walk, settings = self.walk, self.walk.settings
        zero = np.zeros_like(z)
        scale = evaluate(problem, walk.leaf, z, zero + 1.0, walk.width).scale
        tangent = np.asarray(start.tangent, float)
        tangent = tangent / np.linalg.norm(tangent / scale)
        step = settings.step if start.step is None else start.step
        low, high = walk.bounds
        while step >= settings.min_step:
            guess = z + step * tangent
            at = correct(
                problem, walk.leaf, guess, tangent / scale**2, tangent, walk.width,
                settings,
            )  # fmt: skip
            moved = np.linalg.norm((at.z - guess) / scale)
            if at.success and moved <= step and low <= at.z[-1] <= high:
                # the tangent has turned since the start: continue outwards
                outwards = evaluate(problem, walk.leaf, at.z, at.z - z, walk.width)
                if np.all(np.isfinite(outwards.tangent)):
                    return outwards, step
            step /= 2
        raise ValueError(
            "no branch leaves the start along the given tangent; is it a special point?"
        )

    def _resumed(self, problem: AbstractProblem, start: Point, history) -> _Here:
        walk = self.walk
        z = np.append(start.state, start.parameter)
        problem = with_parameter(problem, walk.leaf, z[-1])
        problem = problem.refreshed(z[:-1], problem.parameters)
        at = evaluate(problem, walk.leaf, z, start.tangent, walk.width)
        # to the last digit what they were when the point was found
        at = with_field(at, "tangent", np.asarray(start.tangent))
        at = with_field(at, "scale", np.asarray(start.scale))
        passed = [p for p in history if not p.special and p.label < start.label]
        passed = [p for p in passed if p.signature == start.signature]
        trail = tuple((np.append(p.state, p.parameter), p.tangent) for p in passed)
        self.label = start.label
        here = self._here(problem, at, start.step, start.arclength, trail)
        if passed and passed[0].label == 1:
            first = passed[0]
            self.origin = evaluate(
                problem, walk.leaf, np.append(first.state, first.parameter),
                first.tangent, walk.width,
            )  # fmt: skip
        elif start.label == 1:
            self.origin = at
        return here

    # Walking

    def points(self, here: _Here) -> Iterator[Point]:
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

    def _advance(self, here: _Here) -> tuple[_Here | None, str]:
        """The next point, and why the branch ends with it; None: it ends before."""
        step, control = here.step, self.control
        while True:
            attempt = control.attempt(
                here.problem, self.walk, self.algorithm, here.at, self._stations(here),
                step, self.name,
            )  # fmt: skip
            refusal = attempt.refusal
            if not refusal:
                assert attempt.at is not None
                there = self._moved(here, attempt, step)
                events = self._events(here, there)
                over = self._pass_events(here, there, events)
                if over is not None:
                    return over
                refusal = self._refusal(there)
                if not refusal:
                    closed = self._closed(here, there)
                    if closed is not None:
                        return closed, "the branch is closed: back at its start"
                    return there, attempt.bound
            over = self._end_ahead(here, step)
            if over is not None:
                return over
            if step / 2 < self.walk.settings.min_step:
                return None, (
                    f"the step was halved down to {step:.1e}, and still {refusal}"
                )
            step /= 2

    def _stations(self, here: _Here) -> list[Station]:
        """The last points in the lengths of the current one."""
        scale = here.at.scale
        wanted = max(self.algorithm.predictor.stations, 1)
        trail = (*here.trail, (here.at.z, here.at.tangent))[-wanted:]
        return [
            Station(z / scale, v / scale / np.linalg.norm(v / scale)) for z, v in trail
        ]

    def _moved(self, here: _Here, attempt: Attempt, step: float) -> _Here:
        at = attempt.at
        assert at is not None
        length = float(np.linalg.norm((at.z - here.at.z) / here.at.scale))
        trail = (*here.trail, (here.at.z, here.at.tangent))[-8:]
        there = self._here(
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

    def _here(self, problem, at: Corrected, step: float, arclength, trail) -> _Here:
        return _Here(problem, at, test_values(problem, at), step, arclength, trail)

    def _with_fresh_references(self, here: _Here) -> _Here:
        problem = here.problem
        if type(problem).refreshed is AbstractProblem.refreshed:
            return here
        problem = with_parameter(problem, self.walk.leaf, here.at.z[-1])
        fresh = problem.refreshed(here.at.z[:-1], problem.parameters)
        return here._replace(problem=fresh)

    # Special points

    def _events(self, here: _Here, there: _Here) -> list[str]:
        """Names of the test functions that change sign on the way."""
        if not self.walk.settings.special:
            monitors = here.problem.monitors()
            watched = {k for k, monitor in monitors.items() if monitor.ends}
        else:
            watched = set(there.tests)
        found = []
        for name, after in there.tests.items():
            before = here.tests.get(name, 0.0)
            if name in watched and before * after < 0:
                found.append(name)
        return sorted(found, key=lambda name: name != BRANCH_POINT)

    def _pass_events(self, here: _Here, there: _Here, names: list[str]):
        """Put special points into `pending`; how to go on where one ends it all."""
        monitors = here.problem.monitors()
        found: list[tuple[float, str, Located]] = []
        for name in names:
            values = (here.tests[name], there.tests[name])
            located = locate(here.problem, name, self.walk, here.at, there.at, values)
            way = (located.z - here.at.z) / here.at.scale
            same = [
                other
                for _, _, other in found
                if np.linalg.norm((located.z - other.z) / here.at.scale)
                < 1e-3 * np.linalg.norm((there.at.z - here.at.z) / here.at.scale)
                and other.converged
            ]
            if same and (name not in monitors or not monitors[name].ends):
                continue
            along = float(way @ (here.at.tangent / here.at.scale))
            found.append((along, name, located))
        for _, name, located in sorted(found, key=lambda item: item[0]):
            point = self._special(here, there, name, located)
            if point is None:
                continue
            self.pending.append(point)
            if name in monitors and monitors[name].ends:
                return self._transition(here, point)
        return None

    def _special(self, here: _Here, there: _Here, name: str, located: Located):
        """The special point, or None for a neutral saddle."""
        walk, problem = self.walk, here.problem
        chord = there.at.z - here.at.z
        at = evaluate(problem, walk.leaf, located.z, chord, walk.width)
        if not np.all(np.isfinite(at.tangent)) or name == BRANCH_POINT:
            at = with_field(at, "tangent", chord / np.linalg.norm(chord / at.scale))
        monitors = problem.monitors()
        kind = monitors[name].kind if name in monitors else name
        if located.converged and name not in monitors:
            if not pair_is_complex(problem, kind, walk, located.z, at):
                return None
        coefficient, words = None, ""
        if name not in monitors and located.converged:
            coefficient, words = normal_form(kind, problem, walk.leaf, located.z, at)
        length = float(np.linalg.norm((located.z - here.at.z) / here.at.scale))
        stand = _Here(problem, at, {}, here.step, here.arclength + length, ())
        return self._point(
            stand, kind, located.reason, located.converged, coefficient, words
        )

    def _end_ahead(self, here: _Here, step: float):
        """A zero of an ending monitor just ahead, where a step has failed."""
        for name, monitor in here.problem.monitors().items():
            value = here.tests.get(name, np.nan)
            if not monitor.ends or not np.isfinite(value) or value == 0:
                continue
            located = ahead(here.problem, name, self.walk, here.at, value, 2 * step)
            if located is None:
                continue
            beyond = located.z + 1e-3 * (located.z - here.at.z)
            there = here._replace(at=with_field(here.at, "z", beyond))
            point = self._special(here, there, name, located)
            if point is not None:
                self.pending.append(point)
                return self._transition(here, point)
        return None

    def _transition(self, here: _Here, point: Point):
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

    # Closing

    def _closed(self, here: _Here, there: _Here) -> _Here | None:
        """The start of the branch, where this step came back to it."""
        origin = self.origin
        if origin is None or origin.z.shape != here.at.z.shape:
            return None
        scale = here.at.scale
        start, a, b = origin.z / scale, here.at.z / scale, there.at.z / scale
        chord = b - a
        length = np.linalg.norm(chord)
        along = float((start - a) @ chord) / length
        aside = np.linalg.norm(start - a - along / length * chord)
        if here.arclength < 3 * length or not 0 < along <= length or aside > length:
            return None
        tangent = origin.tangent / scale
        if float(tangent @ chord) < 0.5 * length * np.linalg.norm(tangent):
            return None
        guess = (a + along / length * chord) * scale
        at = correct(
            here.problem, self.walk.leaf, guess, chord / length / scale, chord * scale,
            self.walk.width, self.walk.settings,
        )  # fmt: skip
        miss = np.linalg.norm(at.z / scale - start)
        # points of a branch are a square root of the tolerance apart at most, where
        # they are the same
        if not at.success or miss > np.sqrt(self.walk.settings.tolerance) + 1e-6:
            return None
        back = evaluate(
            here.problem, self.walk.leaf, origin.z, origin.tangent, self.walk.width
        )
        return self._here(
            here.problem, back, here.step, here.arclength + along, here.trail
        )

    # Points

    def _flush(self) -> Iterator[Point]:
        while self.pending:
            yield self.pending.pop(0)

    def _refusal(self, here: _Here) -> str:
        """Why a point is not admissible; empty if it is."""
        if type(here.problem).check is AbstractProblem.check:
            return ""
        point = self._point(here, "regular")
        # it is only judged, and gets no label
        self.label -= 1
        return here.problem.check(point) or ""

    def _end(self, here: _Here, reason: str) -> Point:
        return self._point(here, "end", reason)

    def _point(
        self,
        here: _Here,
        kind: str,
        reason: str = "",
        converged: bool = True,
        coefficient: float | None = None,
        criticality: str = "",
    ) -> Point:
        self.label += 1
        at, problem = here.at, here.problem
        multipliers = eigenvalues_of(at.linearisation)
        z = np.asarray(at.z)
        return Point(
            label=self.label,
            kind=kind,
            parameter=float(z[-1]),
            state=z[:-1],
            multipliers=multipliers,
            stable=is_stable(problem, multipliers),
            tangent=np.asarray(at.tangent),
            scale=np.asarray(at.scale),
            step=float(here.step),
            arclength=float(here.arclength),
            iterations=int(at.iterations),
            converged=bool(converged),
            reason=reason,
            coefficient=coefficient,
            criticality=criticality,
            observed={k: np.asarray(v) for k, v in at.observed.items()},
            tests=dict(here.tests),
            signature=problem.signature,
            parameters=(*problem.free(z[:-1]), float(z[-1])),
            problem=with_parameter(problem, self.walk.leaf, z[-1]),
            leaf=self.walk.leaf,
        )


def _residual(problem: AbstractProblem, z: np.ndarray, leaf: int) -> np.ndarray:
    here = with_parameter(problem, leaf, z[-1])
    return np.asarray(here.residual(jnp.asarray(z[:-1]), here.parameters))


def _largest(size: np.ndarray) -> str:
    return f"{np.max(size):.1e}" if np.all(np.isfinite(size)) else "not finite"
