"""Forces of two arguments, fitted as free functions."""

import dataclasses
import math
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from swing_rig import PARAMETERS, swinging

from jaxcam import simulate
from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.report._bivariate import bivariate_slopes, bivariate_table
from jaxcam.discrepancy.search import _leads as ranking
from jaxcam.discrepancy.search._clock import Clock
from jaxcam.discrepancy.search._earlier import _over_range
from jaxcam.discrepancy.search._free_fits import FreeFits, Subset
from jaxcam.discrepancy.search._free_search import FreeSearch
from jaxcam.discrepancy.search._leads import Lead, Leads
from jaxcam.discrepancy.search._rooms import Rooms
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._shuffled import shuffled
from jaxcam.discrepancy.search._slots import filled, Free, ROOM_OF_TWO_ARGUMENTS
from jaxcam.discrepancy.search._two_arguments import TwoArguments
from jaxcam.discrepancy.terms import (
    Bivariate,
    BivariateForce,
    Family,
    Motion,
    saved_classes,
    Variable,
    Where,
    WithTerms,
)
from jaxcam.models import ImpactOscillator, load_system, save_system


RANGES = {
    Variable.POSITION: (-0.3, 0.4),
    Variable.VELOCITY: (-3.0, 2.0),
    Variable.PHASE: (0.0, 2 * math.pi),
}
PAIRS = [
    (Variable.VELOCITY, Variable.POSITION),
    (Variable.PHASE, Variable.POSITION),
    (Variable.PHASE, Variable.VELOCITY),
]


def _family(argument):
    return Family(Where.FLIGHT, argument, *RANGES[argument], slip=1e-3)


def _of_two(first, second):
    return Bivariate(_family(first), _family(second))


def _force(family, seed=5):
    """A force with random coefficients, and those that are used."""
    used = 0.1 * np.random.default_rng(seed).normal(size=len(family.places))
    every = np.zeros(len(BivariateForce.of(family, "a").coefficients))
    every[list(family.places)] = used
    return BivariateForce.of(family, "a", every), used


def _along(argument, motion):
    return getattr(motion, str(argument))


@pytest.mark.parametrize("first, second", PAIRS)
def test_the_force_is_the_sum_of_products_of_its_basis(first, second):
    """To rounding, within both ranges and in the next cycle of the drive."""
    family = _of_two(first, second)
    term, used = _force(family)
    assert len(used) == math.prod(family.shape)
    for motion in ((0.1, 0.25, -2.1, 1.3), (0.4, -0.1, 0.7, 1.3 + 2 * math.pi)):
        motion = Motion(*(jnp.asarray(x) for x in motion))
        at = [np.array([_along(one, motion)]) for one in (first, second)]
        expected = float((family.basis(*at) @ used)[0])
        found = float(term.acceleration(motion))
        assert found == pytest.approx(expected, rel=1e-12)


def test_the_force_is_constant_beyond_the_ends_of_a_range():
    term, _ = _force(_of_two(Variable.VELOCITY, Variable.POSITION))
    for inside, outside in (((0.4, 1.0), (0.9, 1.0)), ((0.2, -3.0), (0.2, -4.0))):
        one, other = (
            float(term.acceleration(Motion(*(jnp.asarray(x) for x in (0.0, *at, 0.0)))))
            for at in (inside, outside)
        )
        # the direction of motion saturates to rounding
        assert one == pytest.approx(other, rel=1e-12)


@pytest.mark.parametrize("length", [0.2, 0.4, 1.6])
def test_the_prior_has_variance_one_on_average(length):
    """A little more within the ranges, as the sines vanish outside of them."""
    family = _of_two(Variable.PHASE, Variable.POSITION)
    one, other = (np.linspace(f.low, f.high, 60) for f in family)
    basis = family.basis(*(x.ravel() for x in np.meshgrid(one, other)))
    variance = basis**2 @ family.prior_variances(basis.shape[1], length)
    assert 0.9 < np.mean(variance) < 1.4


def test_a_saved_system_moves_as_the_one_that_was_found(tmp_path):
    family = Bivariate(
        dataclasses.replace(_family(Variable.VELOCITY), low=-1.0, high=1.0),
        dataclasses.replace(_family(Variable.POSITION), low=-2.0, high=0.0),
    )
    term, _ = _force(family)
    system = WithTerms(ImpactOscillator(), (term,))
    save_system(system, tmp_path / "model.json")
    again = load_system(tmp_path / "model.json", classes=saved_classes())
    start = jnp.array([-1.0, 0.0])
    one, other = (simulate(s, start, 0.0, 3.0) for s in (system, again))
    np.testing.assert_array_equal(one.final, other.final)
    without = simulate(ImpactOscillator(), start, 0.0, 3.0)
    assert abs(float(one.final[0] - without.final[0])) > 1e-3


def test_the_table_is_the_function_and_its_error_is_that_of_the_coefficients():
    """Exactly on the grid; the straight lines that a rig may represent add no error,
    and the sentence names the place where the rest is largest."""
    family = _of_two(Variable.PHASE, Variable.POSITION)
    term, used = _force(family)
    names = [f"a_{k}" for k in family.places]
    variance = 1e-6
    found = bivariate_table(family, used, variance * np.eye(len(used)), 12, "m/s^2")
    slopes = bivariate_slopes(term, names, 144)
    np.testing.assert_allclose(found.value.ravel(), slopes @ used, rtol=1e-10)
    error = np.sqrt(variance * np.sum(slopes**2, axis=1))
    np.testing.assert_allclose(found.stderr.ravel(), error, rtol=1e-10)
    assert found.words.startswith("a force that depends on the phase and the position;")
    assert "m/s^2" in found.words and "a straight line" in found.words
    # a large error of the slope is not one of the function
    _, position = (np.linspace(f.low, f.high, 12) for f in family)
    line = np.linalg.lstsq(slopes, np.tile(position, 12))[0]
    poor = bivariate_table(
        family, used, variance * np.eye(len(used)) + np.outer(line, line), 12, "m/s^2"
    )
    assert np.median(poor.stderr) < 2 * np.median(found.stderr)


@pytest.mark.parametrize("width", [0.9, 1.1])
def test_a_function_keeps_its_values_over_the_ranges_of_other_recordings(width):
    """To 5 % of its size within its own ranges, over ranges a tenth narrower or wider;
    beyond them, it is nearly constant, as the force is."""
    family = _of_two(Variable.VELOCITY, Variable.POSITION)
    _, used = _force(family)
    used = used * np.sqrt(family.prior_variances(len(used), 0.8))
    every = np.zeros(BivariateForce.size)
    every[list(family.places)] = used
    term = BivariateForce.of(family, "a", every)
    one = Free(family.first, Roughness(), ROOM_OF_TWO_ARGUMENTS, across=family.second)
    others = {
        f.name: dataclasses.replace(f, low=width * f.low, high=width * f.high)
        for f in family
    }
    moved = _over_range(one, used, others)
    assert moved is not None
    part, numbers = moved
    assert part.arguments == ("velocity", "position")
    ends = [(0.95 * width * f.low, 0.95 * width * f.high) for f in family]
    along, across = (
        x.ravel() for x in np.meshgrid(*(np.linspace(*e, 30) for e in ends))
    )
    assert isinstance(part.prior, Bivariate)
    after = part.prior.basis(along, across) @ numbers
    zero = np.zeros_like(along)
    before = jax.vmap(lambda *at: term.acceleration(Motion(*at)))(
        *(jnp.asarray(x) for x in (zero, across, along, zero))
    )
    inside = np.all(
        [(f.low < at) & (at < f.high) for f, at in zip(family, (along, across))], axis=0
    )
    off = np.abs(after - before) / np.max(np.abs(before))
    assert np.max(off[inside]) < 0.05
    assert np.max(off) < 0.2


def _swings(force, noise=1e-4):
    """Recordings of a swing with an additional force, and a search for forces of two
    arguments that has fitted the rig alone to disconnected pieces."""
    problem = swinging(force, (0.15, 0.22, 0.3), 0.8, noise)
    families = (
        Family(Where.FLIGHT, Variable.POSITION, -0.3, 0.3),
        Family(Where.FLIGHT, Variable.VELOCITY, -4.0, 4.0, slip=0.01),
    )
    rooms = Rooms(problem, families, True, False)
    fits = FreeFits([one.name for one in PARAMETERS], (), Policy(followed=1))
    search = TwoArguments(fits, families, rooms, lambda *said: None, Clock(10.0))
    apart = rooms.plain.apart
    bare = fits.fitted(Subset(apart, (), frozenset()), apart.start, 20)
    return search, bare


def _late_spring(x, v):
    """A spring that acts beyond a position that falls with the velocity."""
    return -20.0 * np.maximum(x + 0.03 * v - 0.05, 0.0)


def _leads(search, bare):
    """The forces of one argument, the best first."""
    every = Leads(search.fits, search.forces, (), Policy(), lambda *said: None)
    return every.ranked(search.rooms.plain.apart, bare, True)


@pytest.fixture(scope="module")
def late_spring():
    search, bare = _swings(_late_spring)
    # products have compiled programs of their own
    search.products = SimpleNamespace(tried=lambda *given: [])
    return search, bare, search.tried(bare, bare, 30.0, 0.0)


def test_a_force_of_two_arguments_is_fitted(late_spring):
    """The cost is that of the noise, to 5 %, and the error of the function, without its
    straight lines, is less than a fifth of its rms where the swing moved."""
    search, bare, trials = late_spring
    best = min(trials, key=lambda one: one.score)
    (one,) = best.functions
    assert set(one.arguments) == {"position", "velocity"}
    samples = best.problem.samples
    assert bare.fit.cost > 10 * samples
    assert best.fit.cost < 1.05 * samples
    free = _free(trials)
    (one,) = free.functions
    numbers = np.array([free.fit[name].value for name in one.coefficients])
    rate = math.sqrt(149.0)
    size, angle = np.meshgrid([0.15, 0.22, 0.3], np.linspace(0, 6, 40))
    x, v = (size * np.cos(angle)).ravel(), (-rate * size * np.sin(angle)).ravel()
    known, _ = np.linalg.qr(np.column_stack([np.ones_like(x), x, v]))
    true, value = (
        each - known @ (known.T @ each)
        for each in (_late_spring(x, v), one.prior.basis(v, x) @ numbers)
    )
    off = np.sqrt(np.mean((value - true) ** 2) / np.mean(true**2))
    assert off < 0.2


def _free(trials):
    return next(t for t in trials if t.functions[0].slot == ROOM_OF_TWO_ARGUMENTS)


def test_it_promises_more_than_sums_only_if_no_sum_is_the_force(late_spring):
    search, bare, _ = late_spring
    assert search.promise_more(bare, _leads(search, bare), 30.0)

    def both(x, v):
        return -400.0 * np.maximum(x - 0.1, 0.0) - 0.3 * np.abs(v) * v

    search, bare = _swings(both)
    leads = _leads(search, bare)
    assert search.promised(bare) > leads[0].gain + 30.0
    assert not search.promise_more(bare, leads, 30.0)


def test_its_knockoffs_explain_less(late_spring):
    search, bare, trials = late_spring
    free = _free(trials)
    apart = search.rooms.of(free).apart
    policy = Policy(knockoffs=3)
    ((_, arguments, shares),) = shuffled(search.fits, apart, free, policy, 1)
    assert arguments == ("velocity", "position")
    assert len(shares) == 3 and max(shares) < 1


def test_a_fit_belongs_to_its_room_also_without_its_function(late_spring):
    """The parameters of the rooms have different places."""
    search, bare, trials = late_spring
    rooms, free = search.rooms, _free(trials)
    none = free._replace(functions=())
    for found in (free, none):
        assert rooms.of(found) is rooms.with_two_arguments
    assert rooms.of(bare) is rooms.plain
    assert rooms.for_functions(free.functions) is rooms.with_two_arguments
    assert rooms.for_functions(()) is rooms.plain


def test_no_element_is_added_to_a_force_of_two_arguments(late_spring):
    """No problem has room for both; that of the force holds what is left of a fit."""
    search, bare, trials = late_spring
    free, rooms = _free(trials), search.rooms
    leads = Leads(search.fits, search.forces, (), Policy(), lambda *said: None)
    assert not leads._has_room(free) and leads._has_room(bare)
    filled(rooms.of(free).whole, free.functions)
    with pytest.raises(ValueError, match="no slot 'bivariate_force'"):
        filled(rooms.with_element.whole, free.functions)


@pytest.mark.parametrize(
    ("gain", "left", "ranked"),
    [
        # the term may explain all that the force leaves
        (400.0, 1500.0, ["a term"]),
        # it explains less than half of the 333 that it leaves, per cost of 1.5 a sample
        (150.0, 1500.0, ["a function", "a term"]),
        # nothing but noise is left
        (400.0, 1005.0, ["a function", "a term"]),
    ],
)
def test_beside_a_force_of_two_arguments_terms_come_first(
    gain, left, ranked, monkeypatch, unchecked_types
):
    """Other functions are ranked only if no term may explain what is left."""
    at = _family(Variable.POSITION)
    across = _family(Variable.VELOCITY)
    free = Free(at, Roughness(), ROOM_OF_TWO_ARGUMENTS, across=across)
    problem = SimpleNamespace(samples=1000)
    fit = SimpleNamespace(cost=left, problem=problem)
    found: Any = SimpleNamespace(
        functions=(free,), names=frozenset(), fit=fit, problem=problem
    )
    fits: Any = SimpleNamespace(policy=Policy())
    leads = Leads(fits, (), (), Policy(), lambda *said: None)
    made = {
        "_terms": [Lead(gain, "a term")],
        "_in_flight": [Lead(500.0, "a function")],
        "_elsewhere": [],
    }
    for name, value in made.items():
        monkeypatch.setattr(Leads, name, lambda self, *a, value=value: iter(value))
    monkeypatch.setattr(ranking, "_heated", lambda problem, found: problem)
    wide: Any = problem
    assert [one.label for one in leads.ranked(wide, found, False)] == ranked


def test_a_single_form_that_leaves_noise_has_no_rival(late_spring):
    search, bare, _ = late_spring
    form = _family(Variable.POSITION).primitives[0]
    alone = Free(_family(Variable.POSITION), Roughness(), "force_a", form)
    fit = dataclasses.replace(bare.fit, cost=1.0 * bare.problem.samples)
    found = bare._replace(functions=(alone,), fit=fit)
    assert search.tried(bare, found, 30.0, 0.0) == []


def _made(functions, score):
    fit = SimpleNamespace(cost=score, point=None, problem=SimpleNamespace(samples=10))
    return SimpleNamespace(
        functions=functions,
        names=frozenset(),
        fit=fit,
        score=score,
        problem=fit.problem,
    )


@pytest.mark.parametrize(
    ("first", "later", "alone", "score"),
    [
        # forces of two arguments found first remain if no other function is found
        ([200.0], [], None, 200.0),
        ([200.0], [], 150.0, 150.0),
        # otherwise they are sought in addition to the functions found
        ([], [120.0], 150.0, 120.0),
        ([], [], 150.0, 150.0),
        ([], [120.0], None, None),
    ],
)
def test_the_search_returns_the_fit_with_the_most_evidence(
    first, later, alone, score, monkeypatch, unchecked_types
):
    search: Any = object.__new__(FreeSearch)
    search.apart = search.problem = SimpleNamespace(start=None)
    search.need = SimpleNamespace(preferred=False)
    search.first = ["a lead"]
    bare = _made((), 1000.0)
    found = None if alone is None else _made(("one",), alone)
    for name, value in {
        "_bare": bare,
        "_of_two_first": [_made(("two",), one) for one in first],
        "_of_two": [_made(("two",), one) for one in later],
        "_functions": found,
        "_suffices": False,
    }.items():
        monkeypatch.setattr(FreeSearch, name, lambda self, *a, value=value: value)
    best = FreeSearch.run(search)
    assert (best and best.score) == score
