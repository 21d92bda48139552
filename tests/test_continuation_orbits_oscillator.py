"""Orbits with one impact of the forced oscillator, against closed forms.

With gamma = 1/(1 - w^2), T = 2 pi n / w, k = (1 + r) cot(T/2) / 2 and
m = (1 - r) / (2 w), the orbits with approach speed V against a wall at sigma are

    m V = |gamma| sin(phi),   sigma + k V = |gamma| cos(phi),   0 < phi < pi.
"""

import jax.numpy as jnp
import numpy as np
import pytest

import continuation
from jaxcam.models import ImpactOscillator


SETS = [(2.8, 0.8, 1), (2.6, 0.8, 1), (2.5, 0.6, 1), (2.2, 0.5, 1), (4.3, 0.6, 2)]
TRAPS = [(3.7, 0.8, 2), (1.8, 0.7, 1)]


def wall(system):
    return system.wall


class Exact:
    """The family of orbits with one impact in n forcing periods."""

    def __init__(self, w, r, n):
        self.w, self.r, self.n = w, r, n
        self.gamma, half = 1 / (1 - w * w), np.pi * n / w
        self.k, self.m = (1 + r) / np.tan(half) / 2, (1 - r) / (2 * w)
        self.c, self.s = np.cos(2 * half), np.sin(2 * half)

    def at(self, phi):
        """Wall and approach speed."""
        speed = abs(self.gamma) * np.sin(phi) / self.m
        return abs(self.gamma) * np.cos(phi) - self.k * speed, speed

    @property
    def fold(self):
        return np.arctan2(abs(self.k), -self.m * np.sign(self.k))

    @property
    def flip(self):
        w, r, c = self.w, self.r, self.c
        top = 1 + r * r - 2 * r * c + (1 + r) ** 2 * (1 - w * w) * (1 + c) / 2
        rho = top / ((1 + r) * self.s * w * w)
        return np.arctan2(self.m, rho + self.k)

    def trace(self, phi):
        w, r, c = self.w, self.r, self.c
        sigma, speed = self.at(phi)
        first = -2 * r * c + (1 + r) ** 2 * (1 - w * w) * (1 + c) / 2
        return first - (1 + r) * self.s * w * w * sigma / speed

    def start(self, phi):
        """System, time and state just after the impact."""
        sigma, speed = self.at(phi)
        sine = -self.m * speed / self.gamma
        cosine = (sigma + self.k * speed) / self.gamma
        time = np.arctan2(sine, cosine) / self.w
        system = ImpactOscillator(omega=self.w, restitution=self.r, wall=sigma)
        return system, time, np.array([sigma, -self.r * speed])

    def problem(self, phi):
        system, time, state = self.start(phi)
        problem = continuation.ImpactingOrbits(system, (0,), self.n, 2)
        return problem, np.concatenate([[time / float(system.period)], state])


def first(problem, start, kinds, bounds, direction, **settings):
    """Points up to the first special one of these kinds."""
    seen = []
    for point in continuation.follow(
        problem,
        start,
        wall,
        bounds,
        direction=direction,
        settings=continuation.Settings(**settings),
    ):
        seen.append(point)
        if point.kind in kinds:
            break
    return seen


@pytest.mark.parametrize("case", SETS)
def test_fold_and_flip_as_in_closed_form(case):
    exact = Exact(*case)
    for name in ("fold", "flip"):
        phi = getattr(exact, name)
        middle = (exact.fold + exact.flip) / 2
        begin, end = exact.at(middle)[0], exact.at(phi)[0]
        direction = 1 if end > begin else -1
        points = first(
            *exact.problem(middle), (name, "grazing"), (-4.0, 4.0), direction
        )
        found = points[-1]
        assert found.kind == name and found.converged
        assert abs(found.parameter - end) < 1e-9
        critical = 1.0 if name == "fold" else -1.0
        others = [critical, exact.r**2 * critical]
        np.testing.assert_allclose(np.sort(found.multipliers.real), np.sort(others))


@pytest.mark.parametrize("case", TRAPS)
def test_flip_behind_a_grazing_is_not_reported(case):
    exact = Exact(*case)
    middle = exact.fold + 0.1 * (exact.flip - exact.fold)
    begin, end = exact.at(middle)[0], exact.at(exact.flip)[0]
    direction = 1 if end > begin else -1
    points = first(*exact.problem(middle), ("flip", "grazing"), (-4.0, 4.0), direction)
    found = points[-1]
    assert found.kind == "grazing" and found.converged
    assert min(begin, end) < found.parameter < max(begin, end)
    # the orbit there touches the wall in flight, by the solution between impacts
    time = found.state[0] * 2 * np.pi / exact.w
    t = np.linspace(0, 2 * np.pi * exact.n / exact.w, 200001)[1:-1]
    forced = exact.gamma * np.cos(exact.w * (time + t))
    a = found.state[1] - exact.gamma * np.cos(exact.w * time)
    b = found.state[2] + exact.gamma * exact.w * np.sin(exact.w * time)
    gap = found.parameter - forced - a * np.cos(t) - b * np.sin(t)
    assert abs(gap[100:-100].min()) < 1e-8


def test_resonance_has_the_same_multipliers_for_every_wall():
    exact = Exact(2.0, 0.8, 1)
    problem, start = exact.problem(1.2)
    sigma = exact.at(1.2)[0]
    points = first(
        problem, start, ("grazing",), (sigma - 0.02, sigma + 0.02), 1, special=False
    )
    assert len(points) > 1
    for point in points:
        np.testing.assert_allclose(point.multipliers, [0.8, 0.8], atol=1e-6)


def test_orbit_from_a_guess_with_its_multipliers():
    exact = Exact(2.8, 0.8, 1)
    phi = 0.9 * exact.flip + 0.1 * exact.fold
    system, time, state = exact.start(phi)
    orbit = continuation.periodic_orbit(
        system, state - 0.01, float(system.period), t0=time
    )
    sigma, speed = exact.at(phi)
    assert int(orbit.impacts.count) == 1
    assert float(-orbit.impacts.speed_before[0]) == pytest.approx(speed, abs=1e-9)
    assert complex(sum(orbit.multipliers)).real == pytest.approx(
        exact.trace(phi), abs=1e-8
    )
    assert complex(jnp.prod(orbit.multipliers)).real == pytest.approx(0.64, abs=1e-9)
