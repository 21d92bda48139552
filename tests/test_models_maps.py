"""Smooth systems and maps of chapter 2, against what is known of them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcam.hybrid import flow
from jaxcam.maps import (
    border_collision,
    classify_border_collision,
    feigenbaum_ratios,
    grow_manifold,
    iterate,
    LogisticMap,
    map_attractor,
    map_diagram,
    saddle_at,
    SkewMap,
    SquareRootMap,
    superstable,
)
from jaxcam.maps.normal_forms import NORMAL_FORMS
from jaxcam.models import ForcedOscillator, ImpactOscillator
from variational import poincare_derivative


def largest(found, expected=0.0):
    return np.max(np.abs(np.asarray(found) - np.asarray(expected)))


def mu(system):
    return system.mu


# The logistic map.


def test_ends_of_the_cobwebs_of_figure_2_3():
    """mu = 1.5: the fixed point; 3.3: the period-2 formula; 3.8: chaos."""
    assert iterate(LogisticMap(1.5), 0.8, 200)[-1] == pytest.approx(1 / 3, abs=1e-14)
    twice = LogisticMap(3.3)
    ends = np.sort(np.asarray(iterate(twice, 0.6, 400)[-2:]))
    assert largest(ends, twice.period_two()) < 1e-14
    assert map_attractor(LogisticMap(3.8), 0.1).kind == "chaos"
    assert map_attractor(LogisticMap(3.3), 0.6).kind == "period 2"


def test_lyapunov_exponent_at_four():
    """log 2, to the accuracy of 20 000 iterates."""
    found = map_attractor(LogisticMap(4.0), 0.1234)
    assert found.lyapunov == pytest.approx(np.log(2), abs=0.01)


def test_diagram_of_the_logistic_map():
    """One, two, four values where the cascade says so; chaos is many."""
    values = [2.8, 3.2, 3.5, 3.8]
    points = np.asarray(map_diagram(LogisticMap(), mu, values, keep=128))
    counts = [len(np.unique(np.round(row, 7))) for row in points]
    assert counts[:3] == [1, 2, 4] and counts[3] > 100
    assert abs(points[1].max() - LogisticMap(3.2).period_two()[1]) < 1e-9


def test_feigenbaum_ratio():
    """4.669201609...; the ratios of the superstable cascade converge to it."""
    values = superstable(LogisticMap(), mu, 0.5, (2.0, 3.24), 11)
    # the first two are known: 2 and 1 + sqrt 5
    assert largest(values[:2], [2.0, 1 + np.sqrt(5)]) < 1e-12
    ratios = feigenbaum_ratios(values)
    assert abs(ratios[-1] - 4.669201609102990) < 1e-5
    assert np.all(np.diff(np.abs(ratios[2:7] - 4.669201609102990)) < 0)
    with pytest.raises(ValueError, match="smaller"):
        superstable(LogisticMap(), mu, 0.5, (2.0, 2.0), 4)


# Normal forms.


@pytest.mark.parametrize("name", list(NORMAL_FORMS))
def test_branches_of_the_normal_forms(name):
    """Every branch is one of fixed points, stable where its neighbours go to it."""
    form = NORMAL_FORMS[name]
    for k, branch in enumerate(form.branches):
        for value in (-0.3, 0.3):
            x = float(branch(np.array([value]))[0])
            if np.isnan(x):
                continue
            (stable,) = form.stable(k, value)
            rate = form.field(jnp.asarray(x), jnp.asarray(value))
            if form.discrete:
                image = form.field(rate, jnp.asarray(value))
                assert image == pytest.approx(x, abs=1e-14)
                y = x + 1e-3
                for _ in range(40):
                    y = float(form.field(y, value))
                assert (abs(y - x) < 1e-3) == bool(stable)
            else:
                assert rate == pytest.approx(0.0, abs=1e-14)
                side = 1e-4 if x + 1e-4 else 1e-4
                pulled = float(form.field(jnp.asarray(x + side), jnp.asarray(value)))
                assert (pulled < 0) == bool(stable)


# Flows.


def test_forced_oscillator_in_closed_form():
    """Against DOP853 over three periods, and closed on the cylinder."""
    system = ForcedOscillator(damping=0.07, stiffness=2.0, amplitude=0.8, omega=1.7)
    start = np.array([0.3, -0.4, 0.9])
    end = 3 * float(system.period)
    run = solve_ivp(
        lambda t, s: np.asarray(system.vector_field(jnp.asarray(s))),
        (0, end),
        start,
        method="DOP853",
        rtol=1e-10,
        atol=1e-12,
    )
    found = np.asarray(system.solution(end, jnp.asarray(start)))
    assert largest(found[:2], run.y[:2, -1]) < 1e-8
    assert found[2] == pytest.approx(0.9, abs=1e-12)
    # the Poincare map is affine, contracts areas by exp(-2 zeta T), fixed point steady
    matrix = jax.jacfwd(system.poincare_map)(jnp.zeros(2))
    shrink = np.exp(-2 * 0.07 * float(system.period))
    assert np.linalg.det(matrix) == pytest.approx(shrink, rel=1e-12)
    steady = system.steady(jnp.zeros(()))
    assert largest(system.poincare_map(steady), steady) < 1e-14


def hopf(state):
    """The Hopf normal form in the plane, mu1 = 0.3, mu2 = 1.4, with a third state."""
    x, y, z = state
    r2 = x * x + y * y
    return jnp.stack(
        [0.3 * x - 1.4 * y - x * r2, 1.4 * x + 0.3 * y - y * r2, -0.5 * z + x * y]
    )


def test_linearised_poincare_map():
    """(2.14) against differentiation of the map itself, and the closed multipliers.

    Radius sqrt(mu1), period 2 pi/mu2; multipliers exp(-2 mu1 T) and exp(-T/2).
    """
    period = 2 * np.pi / 1.4

    def section(state):
        return state[1] + 0.3 * state[0] - 0.2 * state[2] - offset

    # a point of the orbit: z is driven by x y = mu1 sin(2 theta)/2
    w = 2 * 1.4
    z = 0.15 * (0.5 * np.sin(0.4) - w * np.cos(0.4)) / (0.25 + w * w)
    r = np.sqrt(0.3)
    point = np.array([r * np.cos(0.2), r * np.sin(0.2), z])
    offset = 0.0
    offset = float(section(point))
    matrix = np.asarray(poincare_derivative(hopf, section, jnp.asarray(point), period))
    values = np.sort(np.abs(np.linalg.eigvals(matrix)))
    exact = np.sort([0.0, np.exp(-2 * 0.3 * period), np.exp(-0.5 * period)])
    assert largest(values, exact) < 1e-8

    def returned(state):
        def crosses(t, s):
            return float(section(s))

        crosses.direction = 1.0  # pyright: ignore
        run = solve_ivp(
            lambda t, s: np.asarray(_hopf(jnp.asarray(s))),
            (0, 1.4 * period),
            state,
            method="DOP853",
            events=crosses,
            rtol=1e-11,
            atol=1e-13,
        )
        late = run.t_events[0] > 0.6 * period
        return run.y_events[0][late][0]

    step = 1e-4
    normal = np.asarray(jax.grad(section)(jnp.asarray(point)))
    # deviations within the section
    _, _, basis = np.linalg.svd(normal[None])
    for along in basis[1:]:
        ends = [returned(point + sign * step * along) for sign in (1, -1)]
        assert largest((ends[0] - ends[1]) / (2 * step), matrix @ along) < 1e-6


_hopf = jax.jit(hopf)


# Piecewise-smooth maps.


@pytest.mark.parametrize(
    ("a", "b", "kind", "twice"),
    [
        (0.5, -0.5, "persistence", False),
        (0.5, -1.5, "persistence", True),
        (0.5, 3.0, "nonsmooth fold", False),
        (1.5, -1.5, "nonsmooth fold", True),
        (-2.0, -1.5, "persistence", False),
    ],
)
def test_border_collisions_are_classified(a, b, kind, twice):
    """Feigin's rules against the fixed points and two-cycles of the skew map itself.

    Fixed points mu/(1 - a) <= 0 and mu/(1 - b) > 0; a two-cycle with one point on
    either side.
    """
    found = classify_border_collision(a, b)
    assert (found.kind, found.period_two) == (kind, twice)
    assert (found.stable_left, found.stable_right) == (abs(a) < 1, abs(b) < 1)
    fixed, cycles = [], []
    for m in (-1.0, 1.0):
        fixed.append([m / (1 - a) <= 0, m / (1 - b) > 0])
        x = m * (1 + b) / (1 - a * b)
        y = a * x + m
        cycles.append(x < 0 < y)
    counts = [sum(side) for side in fixed]
    assert sorted(counts) == ([1, 1] if kind == "persistence" else [0, 2])
    assert any(cycles) == twice


def test_border_collision_is_located():
    found = border_collision(SkewMap(0.4, -1.7, 0.3), mu, 0.3, -0.2)
    assert abs(found.parameter) < 1e-12 and abs(found.state) < 1e-12
    assert found.kind == "persistence" and found.period_two
    with pytest.raises(ValueError, match="jumps"):
        border_collision(SkewMap(0.4, 0.5, 0.3, -1.0), mu, 0.3)
    with pytest.raises(ValueError, match="degenerate"):
        classify_border_collision(0.5, -1.0)


def test_border_collision_of_a_plane_map():
    """Matrices: normal form of trace and determinant; eigenvalues counted exactly."""
    left = np.array([[0.5, 1.0], [-0.3, 0.0]])
    right = np.array([[-1.7, 1.0], [-0.3, 0.0]])
    found = classify_border_collision(left, right)
    values = np.linalg.eigvals(right)
    assert np.sum(values < -1) == 1 and found.period_two
    assert found.kind == "persistence" and found.stable_left and not found.stable_right


def test_period_adding():
    """x -> a x + mu, b x + mu - 1: windows of one right and k left points, exact.

    The cycle exists for a^k/(a^k + s) < mu < a^k/(s + a^k - 1 + a^k b), where
    s = (1 - a^k)/(1 - a); between two windows lies that of the sum of their periods.
    """
    a, b = 0.5, 0.4
    windows = []
    for k in range(1, 5):
        s = (1 - a**k) / (1 - a)
        low, high = a**k / (a**k + s), a**k / (s + a**k - 1 + a**k * b)
        windows.append((low, high))
        for m in (low + 1e-6, (low + high) / 2, high - 1e-6):
            assert map_attractor(SkewMap(a, b, m, -1.0)).period == k + 1
    assert np.all(np.diff([low for low, _ in windows]) < 0)
    for k in range(1, 4):
        between = np.linspace(windows[k][1], windows[k - 1][0], 41)[1:-1]
        periods = {map_attractor(SkewMap(a, b, m, -1.0)).period for m in between}
        assert 2 * k + 3 in periods


def test_robust_chaos():
    """Tent map: exponent log s for every mu > 0, without a periodic window."""
    for m in np.linspace(0.2, 3.0, 8):
        found = map_attractor(SkewMap(1.6, -1.6, m))
        assert found.kind == "chaos"
        assert found.lyapunov == pytest.approx(np.log(1.6), abs=1e-9)
    assert map_attractor(SkewMap(1.6, -1.6, -1.0)).kind == "none"


def test_square_root_map_stretches_without_bound():
    """At the border the slope is infinite: fixed point, then chaos or long periods."""
    assert map_attractor(SquareRootMap(0.5, -0.3)).kind == "fixed point"
    slope = jax.grad(SquareRootMap(0.5, 0.3))(jnp.asarray(1e-12))
    assert slope == pytest.approx(-0.5e6)
    slopes = jax.grad(SquareRootMap(0.5, 0.3))(jnp.asarray(-1.0))
    assert slopes == pytest.approx(0.5)


# Manifolds.


class Parabolic(eqx.Module):
    """(x, y) -> (s x, q y + (s^2 - q) x^2): unstable manifold y = x^2, exactly."""

    s: float
    q: float

    def __call__(self, state):
        x, y = state[0], state[1]
        return jnp.stack([self.s * x, self.q * y + (self.s**2 - self.q) * x * x])


@pytest.mark.parametrize("s", [2.0, -1.7])
def test_manifold_in_closed_form(s):
    """On y = x^2 to the square of the first distance, with even spacing."""
    system = Parabolic(s, 0.4)
    saddle = saddle_at(system, [0.01, -0.02])
    assert largest(saddle.point) < 1e-12
    assert largest(saddle.multipliers, [0.4, s]) < 1e-12
    curve = grow_manifold(
        system, saddle.point, [1.0, 0.0], length=3.0, spacing=0.02, start=1e-6
    )
    assert largest(curve[:, 1], curve[:, 0] ** 2) < 1e-5
    assert curve[-1, 0] > 1.2
    assert np.max(np.linalg.norm(np.diff(curve, axis=0), axis=1)) < 0.03


def test_what_is_no_saddle_is_refused():
    with pytest.raises(ValueError, match="not a saddle"):
        saddle_at(Parabolic(0.5, 0.4), [0.0, 0.0])
    with pytest.raises(ValueError, match="stretches"):
        grow_manifold(Parabolic(2.0, 0.4), [0.0, 0.0], [0.0, 1.0], length=1.0)


class Strobe(eqx.Module):
    """The stroboscopic map of an impact oscillator."""

    system: ImpactOscillator

    def __call__(self, state):
        return flow(self.system, state, 0.0, self.system.period).state


@pytest.mark.slow
def test_manifold_of_an_impacting_saddle():
    """The saddle of the fold pair of P(1,1), closed form; its curve maps to itself.

    (k^2 + m^2) V^2 + 2 k sigma V + sigma^2 - gamma^2 = 0 has two roots beyond
    grazing, V the speed before the impact; the product of the multipliers is r^2.
    """
    omega, r = 2.8, 0.8
    gamma, period = 1 / (1 - omega**2), 2 * np.pi / omega
    k, m = (1 + r) / np.tan(period / 2) / 2, (1 - r) / (2 * omega)
    sigma = -np.sign(k) * 0.5 * abs(gamma) * (1 + np.sqrt(1 + (k / m) ** 2))
    roots = np.roots([k**2 + m**2, 2 * k * sigma, sigma**2 - gamma**2])
    speed = float(np.min(roots[roots > 0]))
    assert np.sum(roots > 0) == 2
    phase = np.arctan2(-m * speed / gamma, (sigma + k * speed) / gamma)
    system = ImpactOscillator(omega=omega, restitution=r, wall=sigma)
    impact = np.mod(phase / omega, period)
    after = flow(system, jnp.array([sigma, -r * speed]), impact, period).state
    strobe = Strobe(system)
    saddle = saddle_at(strobe, after)
    assert largest(saddle.point, after) < 1e-8
    assert np.prod(saddle.multipliers) == pytest.approx(r**2, abs=1e-8)
    curve = grow_manifold(
        strobe,
        saddle.point,
        saddle.directions[:, 1],
        length=0.3,
        spacing=0.01,
        start=1e-4,
    )
    # images of its first half lie on it
    images = jax.vmap(strobe)(jnp.asarray(curve[5 : len(curve) // 3]))
    distance = np.linalg.norm(np.asarray(images)[:, None] - curve[None], axis=-1)
    assert np.max(np.min(distance, axis=1)) < 0.01
