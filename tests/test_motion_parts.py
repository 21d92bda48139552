"""The arithmetic of one step by itself, uncompiled, against polynomials and numpy.

A step of the loop is repeated until it is right, so that a wrong part is often repaired
by the next attempt; here each part must be right alone. Tolerances are relative to the
size of the numbers that go in, which is about one.
"""

import itertools
import math

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BPoly

from jaxcam import Settings
from jaxcam.hybrid.batch._refilled_lanes import costly_first
from jaxcam.hybrid.codes import RowKind
from jaxcam.hybrid.loop._advance import Plan
from jaxcam.hybrid.loop._flight import earliest, judge, moves_in, StepVerdict
from jaxcam.hybrid.loop._functions import Functions
from jaxcam.hybrid.loop._gap_polynomial import (
    Bernstein,
    bernstein,
    crossing,
    end_curvature,
    Jet,
    lowest,
    lowest_point,
    power_coefficients,
    time_to_contact,
    time_to_release,
    time_to_root,
)
from jaxcam.hybrid.loop._iterate import iteration
from jaxcam.hybrid.loop._loop_state import first_state
from jaxcam.hybrid.loop._release import judge_contact
from jaxcam.hybrid.lowering._jaxprs import calls_library
from jaxcam.hybrid.lowering._materialise import without_library
from jaxcam.hybrid.lowering._packing import pack
from jaxcam.hybrid.lowering._sincos import sincos
from jaxcam.hybrid.runge_kutta import step, tableau_of
from jaxcam.hybrid.surface._masked import solve_masked
from jaxcam.models import BouncingBall


S = np.linspace(0.0, 1.0, 401)


def jet(*values) -> Jet:
    return Jet(*(jnp.asarray(float(v)) for v in values))


def jet_of(polynomial: Polynomial, t: float) -> Jet:
    """Value and three derivatives at `t`."""
    return jet(*(polynomial.deriv(k)(t) if k else polynomial(t) for k in range(4)))


def hermite(ends, h, orders) -> Polynomial:
    """The polynomial in s = t/h with the first `orders` rates of the two jets."""
    rows, values = [], []
    for s, end in zip((0.0, 1.0), ends, strict=True):
        for k in range(orders):
            powers = [
                Polynomial.basis(n).deriv(k)(s) if k else Polynomial.basis(n)(s)
                for n in range(2 * orders)
            ]
            rows.append(powers)
            values.append(float(end[k]) * h**k)
    return Polynomial(np.linalg.solve(rows, values))


def random_ends(seed):
    draw = np.random.default_rng(seed)
    return jet(*draw.normal(size=4)), jet(*draw.normal(size=4)), draw.uniform(0.2, 2.0)


# --- the gap inside a step


@pytest.mark.parametrize("seed", range(5))
def test_both_forms_are_the_polynomial_through_the_jets(seed):
    left, right, h = random_ends(seed)
    exact = hermite((left, right), h, 4)
    found = np.array(power_coefficients(left, right, h))
    np.testing.assert_allclose(found, exact.coef, atol=1e-11 * np.abs(exact.coef).max())
    b = np.array(bernstein(left, right, h).coefficients)
    np.testing.assert_allclose(BPoly(b[:, None], [0, 1])(S), exact(S), atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_mistrust_bounds_the_difference_to_degree_five(seed):
    """s^3 (1-s)^3 (p + q (2s - 1)) is at most max |p +- q| / 64."""
    left, right, h = random_ends(seed)
    difference = hermite((left, right), h, 4) - hermite((left, right), h, 3)
    ends = [difference.deriv(3)(s) / 6 for s in (0.0, 1.0)]
    polynomial = bernstein(left, right, h)
    assert float(polynomial.error) == pytest.approx(np.abs(ends).max() / 64, rel=1e-9)
    assert np.abs(difference(S)).max() <= float(polynomial.error) * (1 + 1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_lowest_is_below_the_gap_less_its_error(seed):
    left, right, h = random_ends(seed)
    polynomial = bernstein(left, right, h)
    error = 64 * float(polynomial.error) * (S * (1 - S)) ** 3
    below = hermite((left, right), h, 4)(S) - error
    bound = min(float(lowest(polynomial)), float(left.gap), float(right.gap))
    assert bound <= below.min() + 1e-12
    # and no lower than the jets make it
    b = np.array(polynomial.coefficients)
    assert bound >= b.min() - 2 * float(polynomial.error) - 1e-12


@pytest.mark.parametrize("place", range(1, 7))
def test_lowest_looks_at_every_coefficient_inside(place):
    b = [jnp.asarray(-1.0 if k == place else 1.0) for k in range(8)]
    error = 0.125 if place in (3, 4) else 0.0
    found = lowest(Bernstein(tuple(b), jnp.asarray(error)))
    assert float(found) == -1.0 - 2 * error


@pytest.mark.parametrize("root", [0.05, 0.3, 0.62, 0.97])
def test_crossing_is_the_root(root):
    h = 0.7
    t = Polynomial([0.0, 1.0])
    fall = (root * h - t) * (1 + 0.4 * t**2 + 0.3 * t**5)
    c = power_coefficients(jet_of(fall, 0.0), jet_of(fall, h), h)
    assert float(crossing(c)) == pytest.approx(root, abs=1e-6)


@pytest.mark.parametrize("place", [0.1, 0.45, 0.8])
def test_lowest_point_of_a_parabola(place):
    h = 0.5
    dip = 3 * (Polynomial([-place * h, 1.0])) ** 2 + 0.1
    ends = jet_of(dip, 0.0), jet_of(dip, h)
    found = lowest_point(bernstein(*ends, h), power_coefficients(*ends, h))
    assert float(found) == pytest.approx(place, abs=1e-12)


# --- times ahead


@pytest.mark.parametrize("height, speed", [(1.0, 0.0), (0.3, 2.0), (0.5, -1.0)])
def test_time_to_contact_of_a_throw(height, speed):
    g = 9.81
    exact = (speed + np.sqrt(speed**2 + 2 * g * height)) / g
    found = time_to_contact(jet(height, speed, -g, 0.0), jnp.asarray(0.0))
    assert float(found) == pytest.approx(exact, rel=1e-14)


@pytest.mark.parametrize("rate", [-4.0, 0.0, 3.0])
def test_time_to_contact_of_a_hop_is_the_first_root_of_its_cubic(rate):
    v, a = 0.1, -2.0
    roots = Polynomial([v, a / 2, rate / 6]).roots()
    exact = min(r.real for r in roots if r.real > 0)
    found = time_to_contact(jet(0.0, v, a, rate), jnp.asarray(0.0))
    assert float(found) == pytest.approx(exact, rel=1e-13)


def test_time_to_contact_takes_jerk_and_snap_into_account():
    fall = Polynomial([1.0, -0.5, -2.0, 0.3, 0.1])
    exact = min(r.real for r in fall.roots() if abs(r.imag) < 1e-12 and r.real > 0)
    snap = jnp.asarray(float(fall.deriv(4)(0.0)))
    found = float(time_to_contact(jet_of(fall, 0.0), snap))
    parabola = min(r for r in Polynomial([1.0, -0.5, -2.0]).roots() if r > 0)
    # one step of Newton: the error is squared
    assert abs(found - exact) < 2 * (parabola - exact) ** 2


@pytest.mark.parametrize("a", [1.0, 0.0])
def test_no_contact_ahead(a):
    assert time_to_contact(jet(1.0, 1.0, a, 0.0), jnp.asarray(0.0)) == np.inf


@pytest.mark.parametrize("bend, third", [(0.0, 0.0), (0.6, 0.0), (-0.5, 0.4)])
def test_time_to_release_is_the_root_of_the_cubic(bend, third):
    h, t = 0.4, Polynomial([0.0, 1.0])
    pressure = -0.3 + t + bend * t**2 / 2 + third * t**3 / 6
    ends = [jet(0, 0, pressure(s), pressure.deriv()(s)) for s in (-h, 0.0)]
    exact = min(r.real for r in pressure.roots() if abs(r.imag) < 1e-12 and r.real > 0)
    found = time_to_release(*ends, jnp.asarray(1 / h))
    assert float(found) == pytest.approx(exact, rel=1e-4)
    curve = end_curvature(*ends, jnp.asarray(1 / h))
    assert float(curve) == pytest.approx(bend, abs=1e-12)


def test_no_release_while_the_pressure_grows():
    ends = jet(0, 0, -1.0, -1.0), jet(0, 0, -1.5, -1.0)
    assert time_to_release(*ends, jnp.asarray(2.0)) == np.inf


def test_no_release_ahead_where_the_pressure_turns_back():
    """-1 + 0.1 t - 0.15 t^2 comes no nearer to zero than -0.98."""
    h, pressure = 0.4, Polynomial([-1.0, 0.1, -0.15])
    ends = [jet(0, 0, pressure(s), pressure.deriv()(s)) for s in (-h, 0.0)]
    assert time_to_release(*ends, jnp.asarray(1 / h)) == np.inf


@pytest.mark.parametrize("g", [1e-2, -1e-2, 1e-3])
def test_time_to_root_errs_by_the_fifth_power(g):
    cubic = Polynomial([g, -1.0, 0.4, -0.25])
    exact = min((r for r in cubic.roots()), key=abs).real
    assert abs(float(time_to_root(jet_of(cubic, 0.0))) - exact) < 2 * abs(g) ** 5


# --- verdicts

H, ROOM = jnp.asarray(0.1), jnp.asarray(np.inf)


def flight(path, h=0.1, room=np.inf) -> StepVerdict:
    ends = jet_of(path, 0.0), jet_of(path, h)
    rest = (1e-12, 1e-15, 1.0, room, h)
    return judge(*ends, *(jnp.asarray(float(v)) for v in (h, *rest)))


def test_a_flight_that_stays_above_is_accepted():
    verdict = flight(Polynomial([1.0, -0.5, -4.9]))
    assert not verdict.retake and not verdict.lands and verdict.length == np.inf


def test_a_crossing_is_retaken_up_to_it():
    path = Polynomial([0.03, -0.5, -4.9])
    verdict = flight(path)
    root = min(r for r in path.roots() if r > 0)
    assert verdict.retake and not verdict.lands
    # a proposal, to be judged again: halvings and two steps of Newton
    assert float(verdict.length) == pytest.approx(root, rel=1e-4)


@pytest.mark.parametrize("late", [1e-5, -1e-5])
def test_an_end_close_to_the_surface_lands_by_the_series(late):
    path = Polynomial([0.5 * (0.1 + late), -0.5])
    verdict = flight(path)
    assert verdict.lands and not verdict.retake
    assert float(verdict.offset) == pytest.approx(late, rel=1e-9)
    # what lies beyond the time asked for is left to a later step
    assert bool(flight(path, room=5e-6).lands) == (late < 0)


def test_a_dip_between_positive_ends_is_retaken_to_its_bottom():
    verdict = flight(Polynomial([-0.06, 1.0]) ** 2 - 1e-4)
    assert verdict.retake and not verdict.lands
    assert float(verdict.length) == pytest.approx(0.06, rel=1e-9)


def test_a_gap_that_no_polynomial_follows_is_halved():
    ends = jet(0.01, 0.0, 0.0, 0.0), jet(0.01, 0.0, 0.0, 6000.0)
    rest = (jnp.asarray(v) for v in (0.1, 1e-12, 1e-15, 0.01, np.inf, 0.1))
    verdict = judge(*ends, *rest)
    assert verdict.retake and float(verdict.length) == pytest.approx(0.05)


def test_rounding_of_a_gap_that_has_been_closed_so_far_is_no_dip():
    """An attempt without length, where another constraint is hit: 2e-16 is no gap."""
    left, right = jet(0.0, 0.087, -1.4, 0.2), jet(-2.2e-16, 0.087, -1.4, 0.2)
    # largest gap so far 1.6e-16, of positions known to 2e-15
    rest = (jnp.asarray(v) for v in (0.0, 2e-15, 4e-15, 1.6e-16, np.inf, 0.1))
    verdict = judge(left, right, *rest)
    assert not verdict.retake and not verdict.lands


@pytest.mark.parametrize(
    "gap, velocity, acceleration, wanted",
    [
        (0.0, -1.0, 0.0, True),
        (0.0, 1.0, -1.0, False),
        (0.0, 0.0, -1.0, True),
        (0.0, 0.0, 1.0, False),
        # turns at gap - v^2 / 2a: above zero, and below
        (0.1, -0.1, 1.0, False),
        (0.001, -0.1, 1.0, True),
    ],
)
def test_moves_in(gap, velocity, acceleration, wanted):
    one = jet(gap, velocity, acceleration, 0.0)
    assert bool(moves_in(one, jnp.asarray(1e-15))) == wanted
    if gap == 0.0:
        rest = map(jnp.asarray, (0.0, 1e-12, 1e-15, 1.0, np.inf, 0.1))
        at_once = judge(one, one, *rest)
        assert bool(at_once.lands) == wanted and at_once.offset == 0.0


def verdict(retake, length, lands, offset):
    values = (retake, float(length), lands, float(offset), 0.0)
    return StepVerdict(*map(jnp.asarray, values))


def test_the_earliest_of_several():
    late, soon = verdict(False, np.inf, True, 2.0), verdict(False, np.inf, True, 1.0)
    again = verdict(True, 0.5, False, 0.0)
    for pair, which in (((late, soon), 1), ((soon, late), 0), ((soon, soon), 0)):
        best = earliest(list(pair))
        assert best.lands and float(best.offset) == 1.0 and best.constraint == which
    # nobody lands in a step that is taken again
    best = earliest([soon, again])
    assert best.retake and not best.lands and best.length == 0.5


def contact(
    a0, s0, a1, s1, *, h=0.1, room=np.inf, completing=False, locating=False
) -> StepVerdict:
    """Verdict on pressures `a` at the ends of a step and their rates per step `s`."""
    ends = (jet(0, 0, a, s / h if h else s) for a, s in ((a0, s0), (a1, s1)))
    rest = map(jnp.asarray, (h, 1.0, 1e-15, room))
    flags = jnp.asarray(completing), jnp.asarray(locating)
    return judge_contact(*ends, *rest, *flags)


def test_contact_that_presses_goes_on():
    held = contact(-1.0, 0.1, -0.9, 0.1)
    assert not held.retake and not held.lands and held.length == np.inf


def test_a_pull_within_a_step_is_looked_at_in_halves():
    """It presses at both ends and not in between."""
    assert float(contact(-0.1, 3.0, -0.1, -3.0).length) == pytest.approx(0.05)
    # a sequence of impacts that ends in contact is not judged
    assert not contact(-0.1, 3.0, -0.1, -3.0, completing=True).retake


@pytest.mark.parametrize("bend", [-0.5, 0.0, 0.5])
def test_a_pull_at_the_end_of_a_step_is_retaken_up_to_its_begin(bend):
    t = Polynomial([0.0, 1.0])
    pressure = -0.3 + t + bend * (t**2 - t)
    root = next(r for r in pressure.roots() if 0 < r < 1)
    slope = pressure.deriv()
    found = contact(pressure(0.0), slope(0.0), pressure(1.0), slope(1.0))
    assert found.retake and not found.lands
    assert float(found.length) == pytest.approx(0.1 * root, rel=1e-3)


@pytest.mark.parametrize("late", [1e-9, -1e-9])
def test_contact_lets_go_close_to_the_root(late):
    before = (-0.1 - late, 0.1, -late, 0.1)
    found = contact(*before)
    assert found.lands and not found.retake
    assert float(found.offset) == pytest.approx(late, rel=1e-6)
    assert bool(contact(*before, room=5e-10).lands) == (late < 0)
    assert not contact(*before, completing=True).lands


@pytest.mark.parametrize("top, kept", [(0.0, True), (1e-9, True), (1e-5, False)])
def test_contact_that_only_touches_zero_is_kept(top, kept):
    """The hop of a pull up to `top` would be some top^2 high; rounding hides 1e-15."""
    t = Polynomial([0.0, 1.0])
    pressure = top - 0.5 * (t - 0.07) ** 2
    slope = 0.1 * pressure.deriv()
    found = contact(pressure(0.0), slope(0.0), pressure(0.1), slope(0.1))
    assert bool(found.retake) != kept and not found.lands


def test_contact_that_is_pulled_at_once_lets_go():
    found = contact(0.1, 1.0, 0.1, 1.0, h=0.0)
    assert found.lands and found.offset == 0.0


# --- one attempt as a whole


@pytest.mark.parametrize("room, kind", [(2e-6, RowKind.IMPACT), (5e-7, RowKind.STEP)])
def test_an_impact_beyond_the_end_is_left_out(room, kind):
    """The step ends 1e-6 s before the impact, the run `room` after that step."""
    ball = BouncingBall()
    length = math.sqrt(2 / 9.81) - 1e-6
    t0, t1 = jnp.asarray(0.0), jnp.asarray(length + room)
    functions = Functions(ball, 2)

    @jax.jit
    def attempt(t1):
        lane = first_state(functions, t0, (jnp.asarray(1.0), jnp.asarray(0.0)), t1)
        lane = lane._replace(step=jnp.asarray(length), longest=jnp.asarray(1.0))
        return iteration(functions, Plan.of(ball, Settings(), t0, t1), lane)[1]

    record = attempt(t1)
    assert int(record.kind) == kind and float(record.t) <= float(t1)


# --- the rest


@pytest.mark.parametrize("mask", [*itertools.product([False, True], repeat=3)])
def test_equations_of_the_constraints_in_contact(mask):
    draw = np.random.default_rng(3)
    matrix = np.eye(3) + 0.4 * draw.normal(size=(3, 3)) * (1 - np.eye(3))
    right, held = draw.normal(size=3), np.flatnonzero(mask)
    exact = np.zeros(3)
    exact[held] = np.linalg.solve(matrix[np.ix_(held, held)], right[held])
    found = solve_masked(jnp.asarray(matrix), jnp.asarray(right), jnp.asarray(mask))
    np.testing.assert_allclose(found, exact, atol=1e-13)


@pytest.mark.parametrize("kind", [diffrax.Dopri8, diffrax.Tsit5, diffrax.Dopri5])
def test_a_step_is_that_of_diffrax(kind):
    """Also where a rate is a component of the state, and the step is Nystroem's."""
    solver, t, h = kind(), jnp.asarray(0.3), jnp.asarray(0.2)
    start = tuple(map(jnp.asarray, (0.7, -0.2, 1.1)))

    def field(s, x):
        place, speed, third = x
        return speed, -jnp.sin(place) - 0.3 * speed * third + s, speed - third * place

    def vector(s, y, args):
        return jnp.stack(field(s, tuple(y)))

    terms = diffrax.ODETerm(vector)
    wanted, error, *_ = solver.step(
        terms, t, t + h, jnp.stack(start), None, solver.init(terms, t, t + h,
        jnp.stack(start), None), made_jump=True
    )  # fmt: skip
    found, estimate, _ = step(tableau_of(solver), field, t, start, h)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-14)
    np.testing.assert_allclose(estimate, error, rtol=0, atol=1e-14)


def test_lanes_that_will_take_most_attempts_start_first():
    """Lanes 0 and 10 are at work; lane 0 takes 30 attempts a turn, lane 10 takes 10."""
    work, used, stops = np.array([10, 0]), np.full(2, 60.0), np.array([6.0, 2.0])
    order = costly_first(np.array([9, 1, 5]), work, used, stops)
    np.testing.assert_array_equal(order, [1, 5, 9])


# --- sine and cosine, and what a batch is called with


@pytest.mark.parametrize("reach", [0.8, 3.2, 100.0, 1e6])
def test_sine_and_cosine_err_by_some_rounding(reach):
    x = np.random.default_rng(0).uniform(-reach, reach, 4000)
    sine, cosine = map(np.asarray, jax.jit(sincos)(x))
    assert np.abs(sine - np.sin(x)).max() <= 4e-16
    assert np.abs(cosine - np.cos(x)).max() <= 4e-16


def test_sine_keeps_the_digits_of_a_small_angle():
    x = np.array([-1e-3, 1e-9, 1e-300, 0.0])
    np.testing.assert_allclose(sincos(jnp.asarray(x))[0], np.sin(x), rtol=4e-16, atol=0)
    assert np.all(np.isnan(sincos(jnp.asarray(np.nan))))


def test_packed_arrays_come_back_as_they_were():
    tree = {"a": jnp.asarray(2.0), "b": jnp.arange(6.0).reshape(2, 3), "n": jnp.ones(4)}
    tree |= {"key": jax.random.key(3), "count": jnp.arange(2), "none": None}
    numbers, apart, packing = pack(tree)
    assert numbers.shape == (11,)
    back = packing.unpacked(jnp.asarray(numbers), apart)
    assert jax.tree.structure(back) == jax.tree.structure(tree)
    for one, other in zip(jax.tree.leaves(back), jax.tree.leaves(tree), strict=True):
        assert one.dtype == other.dtype and jnp.all(one == other)


def test_packed_rows_are_those_of_the_lanes():
    tree = {
        "a": jnp.arange(3.0),
        "b": jnp.arange(6.0).reshape(3, 2),
        "n": jnp.arange(3),
    }
    packed = pack(tree, lanes=3)
    numbers, apart = packed.some(np.array([2, 0]))
    back = packed.packing.unpacked(numbers[:, 0], [leaf[0] for leaf in apart])
    assert back["a"] == 2.0 and back["n"] == 2
    np.testing.assert_array_equal(back["b"], [4.0, 5.0])
    assert pack({}, lanes=3).numbers.shape == (0, 3)


@pytest.mark.parametrize("of_state", [False, True])
def test_a_library_call_on_parameters_alone_is_done_before_the_loop(of_state):
    found = []

    @jax.jit
    def outer(mass, x):
        def step(x):
            whole = mass + x[0] * jnp.eye(2) if of_state else mass
            return jnp.linalg.inv(whole) @ x

        made = without_library(step, x)
        found.append(calls_library(jax.make_jaxpr(made)(x).jaxpr))
        return made(x)

    mass, x = jnp.array([[2.0, 0.5], [0.5, 1.0]]), jnp.array([1.0, -3.0])
    whole = mass + jnp.eye(2) if of_state else mass
    np.testing.assert_allclose(outer(mass, x), np.linalg.solve(whole, x), rtol=1e-14)
    assert found == [of_state]
