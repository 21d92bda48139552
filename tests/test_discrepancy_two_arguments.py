"""Forces of two arguments, fitted as free functions."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from swing_rig import PARAMETERS, Swing

from jaxcam import simulate
from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.report._bivariate import bivariate_slopes, bivariate_table
from jaxcam.discrepancy.search._clock import Clock
from jaxcam.discrepancy.search._earlier import _over_range
from jaxcam.discrepancy.search._free_fits import FreeFits, Subset
from jaxcam.discrepancy.search._of_base import within
from jaxcam.discrepancy.search._rooms import Rooms
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._slots import Free, ROOM_OF_TWO_ARGUMENTS
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
from jaxcam.fitting import Model, Problem, Sensor
from jaxcam.models import ImpactOscillator, load_system, save_system
from jaxcam.recordings import Recording, segment


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


def test_a_function_keeps_its_values_over_the_ranges_of_other_recordings():
    """To 5 % of its size, over ranges a tenth narrower."""
    family = _of_two(Variable.VELOCITY, Variable.POSITION)
    _, used = _force(family)
    one = Free(family.first, Roughness(), ROOM_OF_TWO_ARGUMENTS, across=family.second)
    narrow = {
        f.name: dataclasses.replace(f, low=0.9 * f.low, high=0.9 * f.high)
        for f in family
    }
    moved = _over_range(one, used, narrow)
    assert moved is not None
    part, numbers = moved
    assert part.arguments == ("velocity", "position")
    along, across = (
        x.ravel()
        for x in np.meshgrid(np.linspace(-2.6, 1.7, 30), np.linspace(-0.25, 0.34, 30))
    )
    before = family.basis(along, across) @ used
    assert isinstance(part.prior, Bivariate)
    after = part.prior.basis(along, across) @ numbers
    assert np.max(np.abs(after - before)) < 0.05 * np.max(np.abs(before))


@pytest.fixture(scope="module")
def late_spring():
    """A spring that acts beyond a position that falls with the velocity, and the
    search for forces of two arguments with what it needs."""
    noise = 1e-4
    time = 1e-3 * np.arange(1200)

    def force(x, v):
        return -20.0 * np.maximum(x + 0.03 * v - 0.05, 0.0)

    def rate(t, x):
        return x[1], -149.0 * x[0] - 0.1 * x[1] + force(*x)

    rng, recordings = np.random.default_rng(3), []
    for number, start in enumerate((0.15, 0.2, 0.25, 0.3)):
        flown = solve_ivp(
            rate, (0.0, 1.2), (start, 0.0), "DOP853", time, rtol=1e-10, atol=1e-12
        )
        seen = flown.y[0] + noise * rng.normal(size=len(time))
        run = Recording(f"run{number}", time, {"angle_rad": seen})
        recordings.append(segment(run, "angle_rad", noise=noise))
    model = Model(WithTerms(Swing()), {"angle_rad": Sensor(0, noise=noise)})
    problem = Problem.build(model, recordings, [within(one) for one in PARAMETERS])
    families = (
        Family(Where.FLIGHT, Variable.POSITION, -0.3, 0.3),
        Family(Where.FLIGHT, Variable.VELOCITY, -4.0, 4.0, slip=0.01),
    )
    rooms = Rooms(problem, families, False, False)
    fits = FreeFits([one.name for one in PARAMETERS], (), Policy(followed=1))
    search = TwoArguments(fits, families, rooms, lambda *said: None, Clock(10.0))
    bare = fits.fitted(
        Subset(rooms.plain.apart, (), frozenset()), rooms.plain.apart.start, 20
    )
    return search, bare, force


def test_a_force_of_two_arguments_is_fitted(late_spring):
    """What it leaves is noise, to 5 %, and the function is right to a fifth of its rms
    beside the straight lines, where the swing moved."""
    search, bare, force = late_spring
    trials = search.tried(bare, bare, 30.0, 0.0)
    best = min(trials, key=lambda one: one.score)
    (one,) = best.functions
    assert set(one.arguments) == {"position", "velocity"}
    samples = best.problem.samples
    assert bare.fit.cost > 10 * samples
    assert best.fit.cost < 1.05 * samples
    free = next(t for t in trials if t.functions[0].slot == ROOM_OF_TWO_ARGUMENTS)
    (one,) = free.functions
    numbers = np.array([free.fit[name].value for name in one.coefficients])
    rate = math.sqrt(149.0)
    size, angle = np.meshgrid([0.15, 0.2, 0.25, 0.3], np.linspace(0, 6, 40))
    x, v = (size * np.cos(angle)).ravel(), (-rate * size * np.sin(angle)).ravel()
    known, _ = np.linalg.qr(np.column_stack([np.ones_like(x), x, v]))
    true, value = (
        each - known @ (known.T @ each)
        for each in (force(x, v), one.prior.basis(v, x) @ numbers)
    )
    off = np.sqrt(np.mean((value - true) ** 2) / np.mean(true**2))
    assert off < 0.2


def test_a_single_form_that_leaves_noise_has_no_rival(late_spring, monkeypatch):
    search, bare, _ = late_spring
    form = _family(Variable.POSITION).primitives[0]
    alone = Free(_family(Variable.POSITION), Roughness(), "force_a", form)
    fit = dataclasses.replace(bare.fit, cost=1.0 * bare.problem.samples)
    found = bare._replace(functions=(alone,), fit=fit)
    assert search.tried(bare, found, 30.0, 0.0) == []
