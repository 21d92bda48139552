"""The fold near a grazing, the saddle between them, and what comes behind."""

from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar
from textbook_systems import DampedImpactOscillator, parameters

import continuation
from continuation.orbits._start_of_period import sampled
from jaxcam import simulate
from jaxcam.hybrid import Settings
from jaxcam.models import BouncingBall, ImpactOscillator
from variational.orbits import lowest_times


C, D, E, W = 0.1, 1.0, 0.8, 1.0


class Exact:
    """One impact a period; K, the flow over it, and the impact at speed v."""

    def __init__(self, damping=C, omega=W):
        self.c, self.w = damping, omega
        self.period = 2 * np.pi / omega
        self.flow = expm(np.array([[0.0, 1.0], [-1.0, -damping]]) * self.period)

    def forced(self, v):
        """The forced motion at the impact."""
        moved = np.array([D, v]) - self.flow @ np.array([D, -E * v])
        return np.linalg.solve(np.eye(2) - self.flow, moved)

    def amplitude(self, v):
        p, c, w = self.forced(v), self.c, self.w
        return np.hypot(p[0], p[1] / w) * np.hypot(1 - w * w, c * w)

    def multipliers(self, v):
        p, c, w = self.forced(v), self.c, self.w
        # acceleration of the forced motion is -w^2 p; the rest obeys the free equation
        before = -(w**2) * p[0] - (D - p[0]) - c * (v - p[1])
        after = -(w**2) * p[0] - (D - p[0]) - c * (-E * v - p[1])
        jump = np.array([[-E, 0.0], [(after + E * before) / v, -E]])
        return np.linalg.eigvals(self.flow @ jump)

    def start(self, v):
        p, c, w = self.forced(v), self.c, self.w
        lag = np.angle(1 / (1 - w * w + 1j * c * w))
        time = (np.angle(p[0] - 1j * p[1] / w) - lag) / w
        system = DampedImpactOscillator(
            **parameters(
                omega=w,
                damping=c,
                stiffness=1.0,
                amplitude=self.amplitude(v),
                wall=D,
                restitution=E,
            )
        )
        problem = continuation.ImpactingOrbits(system, (0,), 1, 2)
        return problem, np.array([time / self.period, D, -E * v])


def test_fold_saddle_and_grazing_are_told_apart():
    exact = Exact()
    fold: Any = minimize_scalar(
        exact.amplitude, bounds=(1e-6, 0.1), method="bounded", options={"xatol": 1e-13}
    )
    assert fold.fun == pytest.approx(0.0999707536, abs=1e-10)
    problem, start = exact.start(3 * fold.x)
    points = list(
        continuation.follow(
            problem,
            start,
            lambda system: system.amplitude,
            (0.0995, 0.105),
            direction=-1,
        )
    )
    special = [point for point in points if point.special]
    assert [point.kind for point in special] == ["fold", "grazing"]
    assert all(point.converged for point in special)
    first, second = special
    assert abs(first.parameter - fold.fun) < 1e-9
    assert abs(second.parameter - 0.1) < 1e-9
    # the window between them is resolved, and all of it is a saddle
    between = points[points.index(first) + 1 : points.index(second)]
    assert len(between) >= 3
    for point in between:
        speed = -point.state[2] / E
        assert not point.stable and 0 < speed < fold.x
        assert exact.amplitude(speed) == pytest.approx(point.parameter, abs=1e-10)
        np.testing.assert_allclose(
            np.max(np.abs(point.multipliers)),
            np.max(np.abs(exact.multipliers(speed))),
            rtol=1e-6,
        )
    # behind the grazing the orbit has no impact, and is stable at smaller amplitudes
    behind = points[points.index(second) + 1 :]
    assert behind[-1].parameter == 0.0995
    for point in behind:
        assert point.signature.startswith("impacts -") and point.stable
        assert np.max(np.abs(point.state)) < D


@pytest.mark.parametrize("direction", [1, -1])
def test_a_flip_between_a_grazing_and_the_next_point_is_located(direction, tmp_path):
    """Beside the grazing, a multiplier passes -1 within one step on its way to minus
    infinity; amplitude to 1e-9 of the root of multiplier + 1 in closed form.
    """
    exact = Exact(0.9, 1.8)

    def beyond_one(v):
        return float(np.min(exact.multipliers(v).real)) + 1

    speed: Any = brentq(beyond_one, 1e-3, 0.04, xtol=1e-14)
    critical = exact.amplitude(speed)
    grazing = D * np.hypot(1 - exact.w**2, exact.c * exact.w)
    problem, start = exact.start(1.2 * speed)
    bounds = 0.99 * grazing, 1.01 * grazing
    if direction == 1:
        system = eqx.tree_at(
            lambda s: s.amplitude, problem.parameters, jnp.asarray(bounds[0])
        )
        problem, start = system, continuation.periodic_orbit(system)
    found = continuation.branch(
        problem,
        start,
        "amplitude",
        bounds,
        settings=continuation.BranchSettings(step=0.05),
        direction=direction,
    )
    kinds = ["grazing", "flip"][::direction]
    assert [point.kind for point in found.special] == kinds
    (flip,), (graze,) = found.of_kind("flip"), found.of_kind("grazing")
    assert flip.converged and abs(flip.parameter - critical) < 1e-9
    assert abs(graze.parameter - grazing) < 1e-9
    # a point between the two shows that the orbits there are unstable
    (between,) = found.points[min(flip.label, graze.label) : -1][:1]
    assert between.stable is False and min(between.multipliers.real) < -1
    assert [point.label for point in found.points] == list(
        range(1, len(found.points) + 1)
    )
    along = np.array([point.arclength for point in found.points])
    assert np.all(np.diff(along) > 0)
    assert flip.stable is None and graze.stable is None
    if direction == 1:
        return
    # a run interrupted at the point between the two goes on as if it had not been
    arguments = problem, start, "amplitude", bounds
    file = tmp_path / "branch.jsonl"
    for callbacks in ([lambda point: point.label == between.label], []):
        resumed = continuation.branch(
            *arguments,
            settings=continuation.BranchSettings(step=0.05),
            direction=direction,
            out=file,
            resume=True,
            callbacks=callbacks,
        )
    assert len(resumed.points) == len(found.points)
    for one, other in zip(resumed.points, found.points, strict=True):
        assert one.kind == other.kind and one.parameter == other.parameter
        np.testing.assert_array_equal(one.state, other.state)


def test_motion_through_the_wall_is_refused():
    exact = Exact()
    problem, _ = exact.start(1e-3)
    _, start = exact.start(-1e-3)
    amplitude = exact.amplitude(-1e-3)
    assert amplitude > 0.1
    problem = eqx.tree_at(
        lambda p: p.parameters.amplitude, problem, jnp.asarray(amplitude)
    )
    with pytest.raises(ValueError, match="not admissible"):
        next(
            continuation.follow(
                problem, start, lambda system: system.amplitude, (0.0995, 0.105)
            )
        )


@pytest.mark.parametrize("k", [1, 2])
def test_ball_on_a_table(k):
    g, w, r = 9.81, 10.0, 0.4
    gamma_fold = k * np.pi * (1 - r) / (1 + r)
    gamma_flip = np.hypot(gamma_fold, 2 * (1 + r * r) / (1 + r) ** 2)
    gamma = (gamma_fold + gamma_flip) / 2
    amplitude, phase = gamma * g / w**2, np.arccos(gamma_fold / gamma)
    ball = BouncingBall(
        **parameters(gravity=g, restitution=r, amplitude=amplitude, frequency=w)
    )
    period = 2 * np.pi / w
    start = np.array(
        [phase / (2 * np.pi), amplitude * np.sin(phase), g * k * period / 2]
    )
    problem = continuation.ImpactingOrbits(ball, (0,), k, 2)
    for name, exact, direction in (("fold", gamma_fold, -1), ("flip", gamma_flip, 1)):
        found = None
        for point in continuation.follow(
            problem,
            start,
            lambda system: system.amplitude,
            (0.01, 1.0),
            direction=direction,
            settings=continuation.BranchSettings(step=0.002, max_step=0.01),
        ):
            found = point
            if point.special:
                break
        assert found is not None and found.kind == name and found.converged
        assert abs(found.parameter * w**2 / g - exact) < 1e-9
        np.testing.assert_allclose(np.prod(found.multipliers).real, r**2)


def test_penetration_shorter_than_a_step_is_seen():
    # a low bounce shortly before release: it comes back through the wall, and off it
    # again, all within the first of sixteen steps
    early, w = 0.05, 1.1
    t0, u = (np.pi / 2 - early) / w, 0.3 * w * (early / w) ** 2
    gamma = 1 / (1 - w * w)
    a, b = -gamma * np.cos(w * t0), -u + gamma * w * np.sin(w * t0)

    def gap(s):
        return -gamma * np.cos(w * (t0 + s)) - a * np.cos(s) - b * np.sin(s)

    inside: Any = minimize_scalar(
        gap, bounds=(0.5 * early, 2 * early), method="bounded", options={"xatol": 1e-12}
    )
    assert inside.fun < -1e-6
    length = 2.0
    assert inside.x < length / 16 and gap(length) > 0.1
    time, value = lowest_times(
        ImpactOscillator(omega=w, wall=0.0, restitution=0.5),
        jnp.array([t0, 0.0, -u]),
        jnp.asarray(t0 + length),
        16,
    )
    assert abs(float(time[0]) - t0 - inside.x) < 1e-6
    assert abs(float(value[0]) - inside.fun) < 1e-11


@pytest.mark.parametrize("shift", [-0.3, 0.0, 0.3, 1.3])
def test_states_keep_their_period_if_the_start_moves(shift):
    """Row k is the state k periods after the first start, modulo two (1e-9)."""
    system = ImpactOscillator(wall=9.0)
    period = float(system.period)
    times = (shift * period, (shift + 2) * period)
    problem = SimpleNamespace(
        parameters=system, periods=2, shift=shift, settings=Settings()
    )
    problem.times = lambda z, system: times
    problem.start = lambda z, system: z
    start = np.array([-0.3, 0.1])
    rows = sampled(problem, {}, start)["stroboscopic"]
    run = simulate(system, start, *times)
    for k, row in enumerate(rows):
        when = [m * period for m in (k - 2, k, k + 2, k + 4)]
        (when,) = (t for t in when if times[0] < t <= times[1] + 1e-9)
        expected = run.at(np.array([min(when, times[1])]))[0]
        np.testing.assert_allclose(row, expected, atol=1e-9)
