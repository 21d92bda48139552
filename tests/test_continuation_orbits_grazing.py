"""The fold beside a grazing, the saddle between them, and what comes behind."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import minimize_scalar
from textbook_systems import DampedImpactOscillator, parameters

import continuation
from jaxcam.models import BouncingBall, ImpactOscillator
from variational.orbits import lowest_times


C, D, E, W = 0.1, 1.0, 0.8, 1.0


class Exact:
    """One impact a period; K, the flow over it, and the impact at speed v."""

    period = 2 * np.pi / W
    flow = expm(np.array([[0.0, 1.0], [-1.0, -C]]) * period)

    def forced(self, v):
        """The forced motion at the impact."""
        moved = np.array([D, v]) - self.flow @ np.array([D, -E * v])
        return np.linalg.solve(np.eye(2) - self.flow, moved)

    def amplitude(self, v):
        p = self.forced(v)
        return np.hypot(p[0], p[1] / W) * np.hypot(1 - W * W, C * W)

    def multipliers(self, v):
        p = self.forced(v)
        # acceleration of the forced motion is -W^2 p; the rest obeys the free equation
        before = -(W**2) * p[0] - (D - p[0]) - C * (v - p[1])
        after = -(W**2) * p[0] - (D - p[0]) - C * (-E * v - p[1])
        jump = np.array([[-E, 0.0], [(after + E * before) / v, -E]])
        return np.linalg.eigvals(self.flow @ jump)

    def start(self, v):
        p = self.forced(v)
        lag = np.angle(1 / (1 - W * W + 1j * C * W))
        time = (np.angle(p[0] - 1j * p[1] / W) - lag) / W
        system = DampedImpactOscillator(
            **parameters(
                omega=W,
                damping=C,
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
