"""Orbits with one impact of the forced oscillator, against closed forms.

With gamma = 1/(1 - w^2), T = 2 pi n / w, k = (1 + r) cot(T/2) / 2 and
m = (1 - r) / (2 w), the orbits with approach speed V against a wall at sigma are

    m V = |gamma| sin(phi),   sigma + k V = |gamma| cos(phi),   0 < phi < pi.
"""

import jax
import jax.numpy as jnp
import mpmath
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
        settings=continuation.BranchSettings(**settings),
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
    assert abs(lowest_gap(exact, found.state)) < 1e-8


def lowest_gap(exact, state):
    """Lowest gap between impacts of an orbit (phase, wall, speed), in closed form."""
    phase, sigma, speed = state
    time = phase * 2 * np.pi / exact.w
    t = np.linspace(0, 2 * np.pi * exact.n / exact.w, 200001)[1:-1]
    forced = exact.gamma * np.cos(exact.w * (time + t))
    a = sigma - exact.gamma * np.cos(exact.w * time)
    b = speed + exact.gamma * exact.w * np.sin(exact.w * time)
    gap = sigma - forced - a * np.cos(t) - b * np.sin(t)
    return gap[100:-100].min()


def test_monitors_by_a_traced_number_are_those_by_a_whole_one():
    # five periods from impact to impact, so that the gap has minima on the way
    exact = Exact(2.8, 0.8, 1)
    once, row = exact.problem((exact.fold + exact.flip) / 2)
    twice = continuation.ImpactingOrbits(once.parameters, (0, 0), 10, 2)
    # no orbit, so that the two halves differ
    u = jnp.asarray(np.concatenate([row, row + [5.0, 0.01, 0.02]]))

    def one_by_one(u):
        return jnp.stack([twice.watched(k, u, twice.parameters) for k in range(4)])

    def by_number(u):
        return jax.vmap(lambda k: twice.watched(k, u, twice.parameters))(jnp.arange(4))

    found = [
        jax.jit(lambda u, f=f: (f(u), jax.jacfwd(f)(u)))(u)
        for f in (one_by_one, by_number)
    ]
    for a, b in zip(*found, strict=True):
        assert len(np.unique(np.round(a, 12), axis=0)) == 4
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13)


def restitution(system):
    return system.restitution


@pytest.mark.parametrize(
    "name, case",
    [("fold", SETS[0]), ("flip", SETS[0]), ("grazing", TRAPS[1])],
)
def test_curves_in_wall_and_restitution(name, case):
    w, r, n = case
    exact = Exact(w, r, n)
    towards = exact.fold if name == "fold" else exact.flip
    other = exact.flip if name == "fold" else exact.fold
    begin = other + (0.5 if name != "grazing" else 0.1) * (towards - other)
    direction = 1 if exact.at(towards)[0] > exact.at(begin)[0] else -1
    found = first(*exact.problem(begin), (name,), (-4.0, 4.0), direction)[-1]
    curve = continuation.curve(found, (wall, restitution), ((-4.0, 4.0), (0.5, 0.9)))
    values = np.array([point.parameters for point in curve.points])
    # both ends lie on the bounds of the restitution
    np.testing.assert_allclose(np.sort(values[[0, -1], 1]), [0.5, 0.9], atol=0)
    for point, (sigma, r) in zip(curve.points, values, strict=True):
        here = Exact(w, r, n)
        if name == "grazing":
            assert abs(lowest_gap(here, point.state[:3])) < 1e-8
        else:
            assert abs(here.at(getattr(here, name))[0] - sigma) < 1e-9


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


def test_periods_are_counted_and_period_is_in_seconds(unchecked_types):
    exact = Exact(2.8, 0.8, 1)
    phi = 0.9 * exact.flip + 0.1 * exact.fold
    system, time, state = exact.start(phi)
    counted = continuation.periodic_orbit(system, state, periods=1, t0=time)
    assert float(counted.period) == pytest.approx(float(system.period), rel=1e-15)
    with pytest.warns(UserWarning, match="periods=1"):
        same = continuation.periodic_orbit(system, state, 1, t0=time)
    np.testing.assert_array_equal(same.state, counted.state)
    # one second is no whole number of the forcing's 2.24 s
    for given, words in (
        ({"period": 1.0}, "as `periods`"),
        ({"period": 1.0, "periods": 1}, "not both"),
        ({"periods": 0}, "at least 1"),
        ({"periods": 1.5}, "whole number"),
    ):
        with pytest.raises(ValueError, match=words):
            continuation.periodic_orbit(system, state, t0=time, **given)


class Digits:
    """The map from impact to impact, in phase and rebound speed, with fifty digits."""

    def __init__(self, exact, phi):
        self.w, self.r, self.n = mpmath.mpf(exact.w), mpmath.mpf(exact.r), exact.n
        gamma, half = 1 / (1 - self.w**2), mpmath.pi * self.n / self.w
        k, m = (1 + self.r) * mpmath.cot(half) / 2, (1 - self.r) / (2 * self.w)
        speed = abs(gamma) * mpmath.sin(phi) / m
        self.sigma = abs(gamma) * mpmath.cos(phi) - k * speed
        angle = mpmath.atan2(-m * speed / gamma, (self.sigma + k * speed) / gamma)
        self.period = 2 * mpmath.pi / self.w
        self.point = np.array([angle / (2 * mpmath.pi), -self.r * speed])

    def __call__(self, t, v):
        w, gamma = self.w, 1 / (1 - self.w**2)
        a = self.sigma - gamma * mpmath.cos(w * t)
        b = v + gamma * w * mpmath.sin(w * t)

        def position(s):
            free = a * mpmath.cos(s) + b * mpmath.sin(s)
            return gamma * mpmath.cos(w * (t + s)) + free - self.sigma

        s = mpmath.findroot(position, self.n * self.period)
        speed = -gamma * w * mpmath.sin(w * (t + s))
        speed += -a * mpmath.sin(s) + b * mpmath.cos(s)
        return t + s - self.n * self.period, -self.r * speed

    def along(self, *directions):
        """Derivative of the map along these directions, by differences."""
        h = mpmath.mpf(10) ** -8
        total = np.array([mpmath.mpf(0)] * 2)
        for signs in np.ndindex(*[2] * len(directions)):
            moved, weight = self.point, 1
            for sign, direction in zip(signs, directions, strict=True):
                moved = moved + (1 - 2 * sign) * h * direction
                weight *= 1 - 2 * sign
            t, v = self(moved[0] * self.period, moved[1])
            total = total + weight * np.array([t / self.period, v])
        return total / (2 * h) ** len(directions)

    def null_vectors(self, critical):
        """Right and left eigenvectors, the right one of length one."""
        one = np.eye(2).astype(int)
        a = np.stack([self.along(e * mpmath.mpf(1)) for e in one], axis=1)
        m = a - critical * one
        right, left = np.array([-m[0, 1], m[0, 0]]), np.array([-m[1, 0], m[0, 0]])
        right = right / mpmath.sqrt(right @ right)
        return a, right, left / (left @ right)


@pytest.mark.parametrize("case", [(2.8, 0.8, 1), (2.5, 0.6, 1)])
def test_coefficients_of_normal_forms_by_differences_with_many_digits(case):
    exact = Exact(*case)
    with mpmath.workdps(50):
        for name, critical in (("fold", 1), ("flip", -1)):
            phi = getattr(exact, name)
            middle = (exact.fold + exact.flip) / 2
            direction = 1 if exact.at(phi)[0] > exact.at(middle)[0] else -1
            found = first(*exact.problem(middle), (name,), (-4.0, 4.0), direction)[-1]
            digits = Digits(exact, phi)
            a, q, p = digits.null_vectors(critical)
            b = digits.along(q, q)
            if name == "fold":
                want = abs(p @ b) / 2
                assert found.criticality.startswith("the branch lies at")
            else:
                m = a - np.eye(2).astype(int)
                determinant = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
                inner = np.array(
                    [m[1, 1] * b[0] - m[0, 1] * b[1], m[0, 0] * b[1] - m[1, 0] * b[0]]
                )
                inner = inner / determinant
                cubic = digits.along(q, q, q) - 3 * digits.along(q, inner)
                want = (p @ cubic) / 6
                supercritical = "supercritical" if want > 0 else "subcritical"
                assert found.criticality == supercritical
            got = abs(found.coefficient) if name == "fold" else found.coefficient
            assert got == pytest.approx(float(want), rel=1e-6)
