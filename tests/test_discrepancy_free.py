"""Free functions: their spline, their prior, and what a diagnosis makes of them."""

import dataclasses
import math
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import simulate
from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence._unnamed import _simpler
from jaxcam.discrepancy.report._curves import errors_of, graded, level_of
from jaxcam.discrepancy.report._missing import _words
from jaxcam.discrepancy.search import (
    _free_fits,
    Free,
    Hidden,
    occam,
    Roughness,
    roughness,
)
from jaxcam.discrepancy.search._converged import stuck
from jaxcam.discrepancy.search._free_fits import FreeFits, Subset
from jaxcam.discrepancy.search._leads import tie
from jaxcam.discrepancy.terms import (
    Factor,
    families,
    Family,
    FREE,
    free_basis,
    Motion,
    saved_classes,
    Variable,
    Where,
    WithTerms,
)
from jaxcam.fitting.engine import Point
from jaxcam.models import ImpactOscillator, load_system, save_system


SINES = 20
POLICY = Policy()


def _family(argument, low, high, factor=Factor.ONE):
    return Family(Where.FLIGHT, argument, low, high, factor, middle=0.5, slip=1e-3)


@pytest.mark.parametrize(
    "family",
    [
        _family(Variable.POSITION, 0.2, 0.36),
        _family(Variable.TIME, 0.0, 4.0),
        _family(Variable.PHASE, 0.0, 2 * math.pi),
    ],
    ids=lambda one: one.name,
)
def test_the_spline_is_the_sum_of_sines(family):
    """To 0.5 % of its size, with coefficients that are as large for all sines."""
    coefficients = np.random.default_rng(0).normal(size=SINES + 1)
    term = FREE[Where.FLIGHT].of(family, "a", coefficients).prepared()
    at = np.linspace(family.low, family.high, 57)
    found = np.array([float(term.at(x)) for x in at])
    expected = free_basis(family, at, SINES + 1) @ np.append(coefficients[:-1], 0.0)
    assert np.max(np.abs(found - expected)) < 5e-3 * np.max(np.abs(expected))


def test_a_function_of_the_phase_is_periodic_and_others_end():
    coefficients = np.random.default_rng(1).normal(size=SINES + 1)
    phase = FREE[Where.FLIGHT].of(
        _family(Variable.PHASE, 0.0, 2 * math.pi), "a", coefficients
    )
    assert float(phase.at(1.0)) == pytest.approx(
        float(phase.at(1.0 - 6 * math.pi)), abs=1e-12
    )
    angle = FREE[Where.FLIGHT].of(
        _family(Variable.POSITION, 0.2, 0.3), "a", coefficients
    )
    assert float(angle.at(0.4)) == float(angle.at(0.3))


@pytest.mark.parametrize(
    ("factor", "expected"),
    [
        (Factor.ONE, 1.0),
        (Factor.VELOCITY, -0.7),
        (Factor.DIRECTION, -1.0),
        (Factor.DEFLECTION, 0.3 - 0.5),
    ],
)
def test_a_force_is_its_function_times_its_factor(factor, expected):
    family = _family(Variable.POSITION, 0.2, 0.4, factor)
    coefficients = [1.0, 0.5, *[0.0] * (SINES - 2), 9.0]
    term = FREE[Where.FLIGHT].of(family, "a", coefficients)
    numbers = (jnp.asarray(x) for x in (0.1, 0.3, -0.7, 2.0))
    force = term.acceleration(Motion(*numbers))
    assert float(force) == pytest.approx(expected * float(term.at(0.3)), rel=1e-12)


def test_a_saved_system_moves_as_the_one_that_was_found(tmp_path):
    family = _family(Variable.POSITION, -2.0, 0.0)
    coefficients = 0.1 * np.random.default_rng(5).normal(size=SINES + 1)
    term = FREE[Where.FLIGHT].of(family, "a", coefficients).exact()
    system = WithTerms(ImpactOscillator(), (term,))
    save_system(system, tmp_path / "model.json")
    again = load_system(tmp_path / "model.json", classes=saved_classes())
    start = jnp.array([-1.0, 0.0])
    one, other = (simulate(s, start, 0.0, 3.0) for s in (system, again))
    np.testing.assert_array_equal(one.final, other.final)
    without = simulate(ImpactOscillator(), start, 0.0, 3.0)
    assert abs(float(one.final[0] - without.final[0])) > 1e-3


def test_a_function_of_the_velocity_may_jump():
    family = _family(Variable.VELOCITY, -1.0, 1.0)
    term = FREE[Where.FLIGHT].of(family, "a", [*[0.0] * SINES, 2.0])
    for velocity in (-0.3, 0.4):
        numbers = (jnp.asarray(x) for x in (0.1, 0.3, velocity, 2.0))
        force = float(term.acceleration(Motion(*numbers)))
        assert force == pytest.approx(math.copysign(2.0, velocity), rel=1e-12)


@pytest.mark.parametrize("length", [0.1, 0.4, 1.6])
def test_the_prior_has_variance_one_on_average(length):
    family = _family(Variable.POSITION, 0.2, 0.4)
    at = np.linspace(0.2, 0.4, 400)
    basis = free_basis(family, at, SINES + 1)[:, :-1]
    variance = basis**2 @ family.variances(SINES, length)
    # the sines vanish outside the range, so that inside there is a little more
    assert 0.9 < np.mean(variance) < 1.4


@pytest.mark.parametrize("length", [0.1, 0.4, 1.6])
def test_the_prior_of_a_phase_has_variance_one_and_contains_a_constant(length):
    """The variance to a tenth, as one sine of the highest order is left out; an arc
    with its mean to a fifth of its rms."""
    family = _family(Variable.PHASE, 0.0, 2 * math.pi)
    at = np.linspace(0.0, 2 * math.pi, 400, endpoint=False)
    basis = free_basis(family, at, SINES + 1)[:, :-1]
    variance = basis**2 @ family.variances(SINES, length)
    np.testing.assert_allclose(variance, 1.0, atol=0.1)
    assert np.mean(variance) == pytest.approx(1.0, rel=1e-12)
    arc = 1.0 * (np.cos(at - 2.0) > 0.6)
    fitted = basis @ np.linalg.lstsq(basis, arc)[0]
    assert np.sqrt(np.mean((fitted - arc) ** 2)) < 0.2 * np.sqrt(np.mean(arc**2))


def test_the_gain_is_the_marginal_likelihood():
    """Against a Gaussian likelihood written down directly, to 1e-8."""
    rng = np.random.default_rng(2)
    family = _family(Variable.POSITION, 0.0, 1.0)
    at = rng.uniform(0.0, 1.0, 300)
    basis = free_basis(family, at, SINES + 1)
    data = np.sin(7 * at) + 0.1 * rng.normal(size=300)
    design = basis / 0.1
    information, score = design.T @ design, design.T @ (data / 0.1)
    own, none = np.arange(SINES + 1), np.zeros(0, dtype=int)
    found = roughness(
        information, score, none, own, family, np.zeros(SINES + 1), POLICY
    )
    spread = found.size * np.sqrt(family.variances(SINES, found.length))
    covariance = 0.01 * np.eye(300) + (basis[:, :-1] * spread**2) @ basis[:, :-1].T
    direct = data @ data / 0.01 - data @ np.linalg.solve(covariance, data)
    direct -= np.linalg.slogdet(covariance)[1] - 300 * math.log(0.01)
    assert found.gain == pytest.approx(direct, rel=1e-8)
    price = occam(information, none, own[:-1], spread, POLICY.distinct_information)
    assert price == pytest.approx(np.linalg.slogdet(covariance / 0.01)[1], rel=1e-8)
    # a smooth function is not taken for a rough one, nor for a small one
    assert found.length >= 0.1
    assert 0.3 < found.size < 10.0


def test_the_gain_does_not_depend_on_the_point():
    rng = np.random.default_rng(3)
    family = _family(Variable.POSITION, 0.0, 1.0)
    design = rng.normal(size=(200, SINES + 1))
    information = design.T @ design
    score = design.T @ rng.normal(size=200)
    own, none = np.arange(SINES + 1), np.zeros(0, dtype=int)
    value = rng.normal(size=SINES + 1)
    value[-1] = 0.0
    here = roughness(information, score, none, own, family, np.zeros(SINES + 1), POLICY)
    moved = score - information @ value
    there = roughness(information, moved, none, own, family, value, POLICY)
    # twice the logarithm of the likelihood that the move has lost
    lost = 2 * score @ value - value @ information @ value
    assert (there.length, there.size) == (here.length, here.size)
    assert there.gain + lost == pytest.approx(here.gain, abs=1e-6)


def test_information_that_rounding_has_made_negative_counts_as_none():
    """The Occam factor is that of the other coefficients; the sum did not converge."""
    family = _family(Variable.POSITION, 0.0, 1.0)
    own, none = np.arange(SINES + 1), np.zeros(0, dtype=int)
    spread = np.sqrt(family.variances(SINES, 0.3))
    information = np.diag([*np.linspace(5.0, 1.0, SINES), 1.0])
    seen = occam(information, none, own[1:-1], spread[1:], POLICY.distinct_information)
    information[0, 0] = -1e-12
    price = occam(information, none, own[:-1], spread, POLICY.distinct_information)
    assert price == pytest.approx(seen, rel=1e-12)
    zero = np.zeros(SINES + 1)
    gain = roughness(information, zero, none, own, family, zero, POLICY).gain
    assert np.isfinite(gain)


def test_what_free_parameters_imitate_is_no_function():
    """Its gain is nothing beside chi-square one, that of a parameter by chance."""
    rng = np.random.default_rng(4)
    family = _family(Variable.POSITION, 0.0, 1.0)
    at = rng.uniform(0.0, 1.0, 300)
    basis = free_basis(family, at, SINES + 1)
    # the rig can do whatever the sines can
    design = np.column_stack([basis[:, :-1], basis])
    information, score = design.T @ design, design.T @ rng.normal(size=300)
    free, own = np.arange(SINES), np.arange(SINES, 2 * SINES + 1)
    found = roughness(
        information, score, free, own, family, np.zeros(SINES + 1), POLICY
    )
    assert found.gain < 1e-6


def test_only_forces_are_averaged_over_an_integration_step():
    """The velocity of a surface is a derivative: averaged, it would be another one."""
    found = families(
        (0.0, 1.0), (-1.0, 1.0), (0.0, 2.0), (0.0, 4.0),
        turned=True, gaps=(0, 1), slip=0.01, motion_unit="m",
        strides={Variable.TIME: 0.1, Variable.POSITION: 0.2},
    )  # fmt: skip
    forces = [one for one in found if one.where is Where.FLIGHT]
    assert {one.stride for one in forces} == {0.0, 0.1, 0.2}
    assert all(one.stride == 0 for one in found if one.where is not Where.FLIGHT)


def test_a_table_has_several_points_in_a_jump():
    """Its ends stay; a function that is not finite has equidistant points."""
    even = np.linspace(0.0, 1.0, 48)
    found = graded(even, lambda x: np.tanh((x - 0.4) / 0.01))
    assert found[0] == 0.0 and found[-1] == pytest.approx(1.0)
    assert np.all(np.diff(found) > 0)
    assert np.sum(np.abs(found - 0.4) < 0.02) > 8 > np.sum(np.abs(even - 0.4) < 0.02)
    assert graded(even, lambda x: np.where(x > 0.5, np.nan, x)) is even


def test_families_have_one_place_each_and_different_names():
    both = families(
        (0.0, 1.0), (-1.0, 1.0), (0.0, 2.0), (0.0, 4.0),
        turned=True, gaps=(0, 1), slip=0.01, motion_unit="m", strides={},
    )  # fmt: skip
    names = [one.name for one in both]
    assert len(set(names)) == len(names)
    assert {one.where for one in both} == set(Where) - {Where.DRIVE}
    # each gap has its own restitution and surface
    by_gap = [[one for one in both if one.constraint == gap] for gap in (0, 1)]
    assert {one.where for one in by_gap[1]} == {Where.IMPACT, Where.CONTACT}
    for where in (Where.IMPACT, Where.CONTACT):
        first, second = (
            [one.arguments for one in gap if one.where is where] for gap in by_gap
        )
        assert first == second
    free = families(
        (0.0, 1.0), (-1.0, 1.0), (0.0, 2.0), (0.0, 4.0),
        turned=False, gaps=(), slip=0.01, motion_unit="m", strides={},
    )  # fmt: skip
    assert {one.where for one in free} == {Where.FLIGHT, Where.SENSOR}
    assert all(one.argument is not Variable.PHASE for one in free)


def test_an_undetermined_straight_line_has_no_part_in_the_error():
    """A constant and a slope that the rig represents as well are known to 1, a sine to
    0.01: so is its largest difference from a straight line."""
    family = Family(Where.FLIGHT, Variable.VELOCITY, -1.0, 1.0)
    along = np.linspace(-1.0, 1.0, 201)
    basis = np.stack([np.ones_like(along), along, np.cos(np.pi * along)], axis=1)
    covariance = np.diag([1.0, 1.0, 1e-4])
    value = basis @ np.array([3.0, -2.0, 0.5])
    level = errors_of(level_of(family, along, basis), covariance)
    assert np.max(errors_of(basis, covariance)) > 1.0
    assert np.max(level) == pytest.approx(0.01, rel=0.02)
    words = _words(family, "force", along, value, level)
    assert "differs most from a straight line at velocity" in words
    assert "rad/s, by" in words and words.endswith("rad/s^2")
    # a function of time or phase may contain a slope
    timed = dataclasses.replace(family, argument=Variable.TIME)
    slope = level_of(timed, along, basis)[:, 1]
    np.testing.assert_allclose(slope, along, atol=1e-12)


@pytest.mark.usefixtures("unchecked_types")
def test_a_fit_that_fails_with_a_new_smoothness_does_not_replace_the_one_before(
    monkeypatch,
):
    """The second fit remains above the cost that it should fall below: the functions
    and the cost are those of the first.
    """
    problem = SimpleNamespace(samples=100)
    late = POLICY.late_attempts

    def planned(cost, iterations):
        return SimpleNamespace(
            cost=cost, iterations=iterations, point=None, problem=problem
        )

    fits = iter([planned(100.0, 3), planned(140.0, late)])
    monkeypatch.setattr(_free_fits, "fit", lambda *_, **__: next(fits))
    for name in ("filled", "heated"):
        monkeypatch.setattr(_free_fits, name, lambda given, _: given)
    monkeypatch.setattr(_free_fits, "_recentred", lambda *given: given[-1])
    monkeypatch.setattr(_free_fits, "alike", lambda *_: False)

    class Planned(FreeFits):
        def free(self, found):
            return []

        def _rougher(self, subset, functions, point, heat):
            return ("rougher",)

        def score(self, subset, found):
            return found.cost + 5.0

    subset = Subset(problem, ("first",), frozenset())  # pyright: ignore
    start = Point(np.zeros(1), np.zeros(1))  # pyright: ignore
    found = Planned((), (), POLICY).fitted(subset, start, beaten=120.0)  # pyright: ignore
    assert (found.functions, found.score) == (("first",), 105.0)


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize("cost", [np.inf, np.nan])
def test_a_failed_fit_has_an_infinite_score(cost):
    """Its cost per sample scales no tolerance."""
    failed = SimpleNamespace(cost=cost, problem=SimpleNamespace(samples=100))
    smooth = SimpleNamespace(price=lambda samples: 0.0, smooth=True)
    subset = Subset(failed.problem, (smooth,), frozenset())  # pyright: ignore
    assert FreeFits((), (), POLICY).score(subset, failed) == np.inf  # pyright: ignore


@pytest.mark.usefixtures("unchecked_types")
def test_a_fit_is_made_only_once():
    """A second search with the same start, limits and problem finds the fit; any other
    is made.
    """
    made = []

    class Counted(FreeFits):
        def _fitted(self, *given):
            made.append(given)
            return len(made)

    def start(value):
        return Point(np.array([value]), np.zeros(2))  # pyright: ignore

    fits, problems = Counted((), (), POLICY), (SimpleNamespace(), SimpleNamespace())
    one, other = (Subset(p, ("a",), frozenset()) for p in problems)  # pyright: ignore
    same = [fits.fitted(one, start(1.0), beaten=5.0) for _ in range(3)]  # pyright: ignore
    assert same == [1, 1, 1]
    others = [
        (one, start(2.0), None, 5.0),
        (one, start(1.0), None, 6.0),
        (one, start(1.0), 9, 5.0),
        (one._replace(names=frozenset({"drag"})), start(1.0), None, 5.0),
        (one._replace(functions=("b",)), start(1.0), None, 5.0),
        (other, start(1.0), None, 5.0),
    ]
    assert [fits.fitted(*each) for each in others] == [2, 3, 4, 5, 6, 7]


@pytest.mark.parametrize(
    ("score", "ties"), [(900.0, True), (1019.0, True), (1021.0, False)]
)
def test_a_function_that_single_pieces_do_not_exclude_ties(
    score, ties, unchecked_types
):
    """The chosen one has a score of 1000 and a cost of twice the noise: up to twice
    `Policy.tie` above it, and if it is better.
    """

    def alone(score):
        fit = SimpleNamespace(cost=2000.0, problem=SimpleNamespace(samples=1000))
        return SimpleNamespace(score=score, fit=fit)

    fits = {"sensor": alone(1000.0), "surface": alone(score)}
    assert tie(fits, "surface", "sensor", Policy()) == ties  # pyright: ignore
    assert not tie(fits, "force", "sensor", Policy())  # pyright: ignore


def test_an_edge_between_two_impacts_is_sharp_in_a_fit():
    """Its value at an impact is that of one side, to rounding, while the derivative
    with respect to its place shows the way to an impact nearby; in a simulation, the
    surface does not jump."""
    family = Family(Where.CONTACT, Variable.TIME, 0.0, 6.0)
    step = next(one for one in family.primitives if one.name == "step")

    def height(edge, t, exact=False):
        numbers = [0.3, edge, *[0.0] * 23]
        term = FREE[Where.CONTACT].of(family, "a", numbers, step)
        term = term.exact() if exact else term.prepared()
        return term.contact(Motion(*(jnp.asarray(x) for x in (t, 0.0, 0.0, 0.0))))

    window = next(one for one in family.primitives if one.name == "window")
    for numbers in ([0.3, 0.2, 0.6], [-0.3, 0.2, 0.6], [0.3, 0.6, 0.2]):
        term = FREE[Where.CONTACT].of(family, "a", [*numbers, *[0.0] * 22], window)
        at = [Motion(*(jnp.asarray(x) for x in (t, 0.0, 0.0, 0.0))) for t in (2.4, 4.2)]
        inside, outside = (float(term.prepared().contact(motion)) for motion in at)
        smooth = float(term.exact().contact(at[0]))
        assert inside == pytest.approx(smooth, abs=1e-9) and outside == 0.0
    for off, value in ((-1e-3, 0.0), (1e-3, 0.3)):
        at = 3.0 + off
        assert float(height(0.5, at)) == pytest.approx(value, abs=1e-12)
        assert float(jax.grad(height)(0.5, at)) < -10
        assert float(jax.grad(height, 1)(0.5, at)) == 0.0
        assert 0.1 < float(height(0.5, at, exact=True)) < 0.2
    assert abs(float(jax.grad(height)(0.5, 3.5))) < 1e-6


def test_a_single_formula_replaces_several_terms_only_if_it_is_simpler(
    unchecked_types,
):
    """Two terms that leave more than noise, with a BIC of 1000 and two parameters."""
    family = _family(Variable.VELOCITY, -1.0, 1.0)
    form = next(one for one in family.primitives if one.name == "power of speed")
    one = Free(family, Roughness(), "force_a", form)
    best = SimpleNamespace(bic=1000.0, count=2)

    def simpler(functions=(one,), names=(), score=900.0, noise=True):
        search = SimpleNamespace(policy=POLICY, falls_short=lambda *a, **k: not noise)
        found = SimpleNamespace(functions=functions, names=names, score=score)
        return _simpler(search, found, best)  # pyright: ignore

    assert simpler()
    assert not simpler(score=995.0)
    assert not simpler(noise=False)
    assert not simpler(names=("viscous_damping",))
    assert not simpler(functions=(dataclasses.replace(one, primitive=None),))
    assert not simpler(functions=(one, dataclasses.replace(one, slot="force_b")))
    best.count = 1
    assert not simpler()


class _Element(Hidden):
    """An element that has changed by a fraction of the allowed step."""

    def __init__(self, moved):
        object.__setattr__(self, "moved", moved)

    def moved_from(self, other):
        return self.moved


@pytest.mark.parametrize(
    ("costs", "moved", "given_up"),
    [
        ([90.0, 25.6, 24.9, 24.2, 23.5], 0.1, True),
        # its parameters still change by the largest step, as on the way to a resonance
        ([190.0, 181.0, 161.0, 139.0], 1.0, False),
        ([96.0, 48.0, 24.0, 12.0], 0.1, False),
        ([3.3, 3.2, 3.1, 3.0], 0.1, False),
        ([25.6, 24.9], 0.1, False),
    ],
)
def test_an_element_that_hardly_changes_and_leaves_a_poor_fit_is_given_up(
    costs, moved, given_up
):
    """Costs per sample of successive fits; a fit is poor above 4."""
    pair = [_Element(moved)], [_Element(0.0)]
    assert stuck(costs, *pair, 10, POLICY) is given_up
