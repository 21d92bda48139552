"""A fit says `converged` only where its result can be trusted, and why it cannot."""

import dataclasses
import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from fitting_rigs import DraggedBall
from scipy.integrate import solve_ivp

from jaxcam import fitting
from jaxcam.discrepancy.policy import Policy
from jaxcam.discrepancy.search import within_tolerances
from jaxcam.fitting.engine._pieces import FREE, IMPACT, spans
from jaxcam.hybrid import HybridSystem
from jaxcam.recordings import Recording, segment
from jaxcam.recordings.cut import Boundary, Flight
from jaxcam.recordings.cut._segments import impacts_of, Segments


NOISE = 1.2e-4
STIFFNESS, DAMPING = 60.0, 0.1


class Swing(HybridSystem):
    """x'' = -(stiffness / mass) f(x - centre) - damping x', f the sine or linear."""

    state_names = ("angle", "rate")

    stiffness: float = STIFFNESS
    damping: float = DAMPING
    mass: float = 1.0
    centre: float = 0.0
    linear: bool = eqx.field(static=True, default=False)

    def vector_field(self, t, state):
        off = state[0] - self.centre
        pull = off if self.linear else jnp.sin(off)
        rate = -self.stiffness / self.mass * pull - self.damping * state[1]
        return jnp.stack([state[1], rate])

    def gap(self, t, state):
        return state[0] + 10.0

    def impact(self, t, state):
        return jnp.stack([state[0], -state[1]])


@functools.cache
def swinging(samples: int, linear: bool = False, seed: int = 0):
    """Eight periods by DOP853, read with white noise, as one flight."""
    time = np.arange(8 * samples) * (2 * np.pi / np.sqrt(STIFFNESS) / samples)

    def field(t, y):
        pull = y[0] if linear else np.sin(y[0])
        return [y[1], -STIFFNESS * pull - DAMPING * y[1]]

    found = solve_ivp(
        field, (0, time[-1]), [0.8, 0.0], "DOP853", time, rtol=1e-11, atol=1e-12
    )
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(time))
    record = Recording("swing", time, {"angle": found.y[0] + noise})
    return segment(record, "angle", noise=NOISE)


def problem_of(part, system, names=("stiffness", "damping"), **more):
    model = fitting.Model(system, {"angle": fitting.Sensor(0, noise=NOISE)})
    parameters = [
        fitting.Parameter(name, lambda m, n=name: getattr(m.system, n), **more)
        for name in names
    ]
    return fitting.Problem.build(model, [part], parameters)


@pytest.mark.parametrize(("samples", "linear"), [(15, True), (65, False), (81, False)])
def test_the_frequency_is_found_at_any_number_of_samples_a_period(samples, linear):
    """Started at the truth; within 3.3 standard errors, and the noise is what is left.

    Pieces longer than a period gave states off by -8.5 rad/s and a stiffness of 0.
    """
    part = swinging(samples, linear)
    found = fitting.fit(problem_of(part, Swing(linear=linear)))
    assert found.converged, found.message
    assert abs(found["stiffness"].value - STIFFNESS) < 3.3 * found["stiffness"].stderr
    assert abs(found["damping"].value - DAMPING) < 3.3 * found["damping"].stderr
    flown, _ = spans(part)
    period = 2 * np.pi / np.sqrt(STIFFNESS)
    longest = max(span.stop - span.start for span in flown)
    # half a period, or twelve samples where those are more
    assert longest < max(0.8 * period, 12.5 * period / samples)


def test_states_to_begin_with_are_near_the_motion():
    """Rates within 0.2 of their amplitude of 6.2 rad/s; they were off by 8.5 rad/s."""
    part = swinging(65)
    problem = problem_of(part, Swing())
    flown, _ = problem.spans[0]
    truth = np.gradient(part.recording["angle"], part.recording.time)
    rows = [int(span.rows[0]) for span in flown[1:]]
    rates = np.asarray(problem.start.states)[0, 1 : len(flown), 1]
    assert np.max(np.abs(rates - truth[rows])) < 0.2 * 0.8 * np.sqrt(STIFFNESS)


def test_a_fit_far_above_the_noise_has_not_converged():
    """A linear spring for a sine at 0.8 rad: every optimum is a poor fit."""
    found = fitting.fit(problem_of(swinging(65), Swing(linear=True)))
    assert found.cost > 4 * found.problem.samples
    assert not found.converged
    doubts = [one.doubt for one in found.reasons]
    assert fitting.Doubt.POOR_FIT in doubts
    assert "The fit is poor" in found.message
    assert found.to_json()["reasons"][0]["doubt"] in ("poor_fit", "no_optimum")


def test_what_a_fit_says_cannot_disagree_with_what_it_holds():
    found = fitting.fit(problem_of(swinging(65), Swing()))
    assert found.converged and not found.reasons
    worse = dataclasses.replace(
        found,
        costs=found.costs._replace(flown=100.0 * np.asarray(found.costs.flown)),
    )
    assert not worse.converged
    broken = dataclasses.replace(found, cost=float("nan"))
    assert [one.doubt for one in broken.reasons] == [fitting.Doubt.NOT_FINITE]
    with pytest.raises(AttributeError):
        found.converged = False  # pyright: ignore


def test_a_parameter_at_its_bound_is_said():
    found = fitting.fit(problem_of(swinging(65), Swing(), ("damping",), lower=0.2))
    assert found["damping"].value == 0.2
    assert fitting.Doubt.ON_A_BOUND in [one.doubt for one in found.reasons]
    assert "damping is at its lower bound 0.2" in found.message


@pytest.mark.parametrize(
    ("names", "hidden"),
    [
        (("stiffness", "mass", "damping"), {"stiffness", "mass"}),
        (("stiffness", "centre", "offset"), {"centre", "offset"}),
    ],
)
def test_what_the_data_do_not_constrain_is_named(names, hidden):
    """Only stiffness over mass acts; a shifted centre is a shifted sensor."""
    model = fitting.Model(Swing(), {"angle": fitting.Sensor(0, noise=NOISE)})
    parameters = [
        fitting.Parameter("offset", lambda m: m.sensors["angle"].offset)
        if name == "offset"
        else fitting.Parameter(name, lambda m, n=name: getattr(m.system, n))
        for name in names
    ]
    problem = fitting.Problem.build(model, [swinging(65)], parameters)
    found = fitting.fit(problem)
    assert not found.converged
    assert [set(one.names) for one in found.unconstrained] == [hidden]
    assert all(name in found.message for name in hidden)
    for one in found.estimates:
        assert np.isfinite(one.stderr) == (one.name not in hidden)
    np.testing.assert_allclose(np.diag(found.correlation), 1.0)


class Broken(Swing):
    """A field that is not a number below -0.5 rad."""

    def vector_field(self, t, state):
        rate = super().vector_field(t, state)
        return rate.at[1].add(jnp.where(state[0] < -0.5, jnp.nan, 0.0))


def test_a_model_that_gives_no_numbers_is_a_sentence():
    with pytest.raises(ValueError, match="not finite in swing"):
        problem_of(swinging(65), Broken())


def test_an_information_with_nan_is_a_sentence():
    from jaxcam.fitting.engine import invert_information

    with pytest.raises(ValueError, match="not finite"):
        invert_information(np.array([[np.nan, 0.0], [0.0, 1.0]]))


def test_a_bounce_of_few_samples_ties_the_flights_on_both_sides():
    """Six samples between two impacts; the restitution of 0.2 within 3.3 errors."""
    gravity, r, interval, noise = 9.81, 0.2, 5e-3, 1e-5
    speed = 30 * interval * gravity / 2
    first, second = 2 * speed / gravity, 2 * r * speed / gravity
    time = interval * np.arange(36) + 1e-3
    past = time - first
    height = np.where(
        past < 0,
        speed * time - gravity * time**2 / 2,
        r * speed * past - gravity * past**2 / 2,
    )
    rng = np.random.default_rng(5)
    record = Recording("ball", time, {"h": height + noise * rng.standard_normal(36)})
    start = Boundary(float(time[0]), np.nan, "end of record", "")
    hits = [Boundary(t, 1e-5, "impact", "") for t in (first, first + second)]
    flights = (
        Flight(start, hits[0], 0, 30, 0.3),
        Flight(hits[0], hits[1], 30, 36, 0.01),
    )
    part = Segments(record, "h", noise, time, flights, (), impacts_of([]))
    flown = spans(part)[0]
    assert [span.joint for span in flown] == [FREE, IMPACT]
    assert len(flown[1].rows) < 8
    model = fitting.Model(
        DraggedBall(restitution=0.3), {"h": fitting.Sensor(0, noise=noise)}
    )
    parameter = fitting.Parameter("restitution", lambda m: m.system.restitution)  # pyright: ignore
    found = fitting.fit(fitting.Problem.build(model, [part], [parameter]))
    one = found["restitution"]
    assert found.converged, found.message
    assert one.stderr < 0.01 and abs(one.value - r) < 3.3 * one.stderr


def test_a_report_compares_within_the_tolerances():
    """Data that ask for 60 of a stiffness stated as 50 +- 1: compared is 51."""
    system = Swing(stiffness=50.0)
    problem = problem_of(swinging(65), system, ("stiffness",), tolerance=1.0)
    before = fitting.fit(problem)
    assert before["stiffness"].value > 55
    best = dataclasses.replace(before, point=problem.start)
    within = within_tolerances(before, best, ("stiffness",), Policy())
    assert within["stiffness"].value == pytest.approx(51.0, abs=1e-9)
    assert within_tolerances(best, best, ("stiffness",), Policy()) is best
