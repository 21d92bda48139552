"""Random systems against an event loop of scipy: a sample of `benchmarks/attack.py`.

Errors up to 1e-7 of the size of the motion pass, or ten times what a change of the
start by 1e-8 does; no gap below -1e-9 of that size, no rise of energy above 1e-8 of it.
The event loop itself is held against closed forms.
"""

import dataclasses

import numpy as np
import pytest

from benchmarks import _attack_verdict
from benchmarks._attack_systems import draw, Problem, SHAPES
from benchmarks._attack_truth import motion
from benchmarks._attack_verdict import judge, know
from benchmarks.attack import attack, WRONG
from jaxcam.hybrid import RESULTS


def seeds(shape: tuple[int, int], number: int) -> list[int]:
    """The first seeds of so many coordinates and gaps."""
    first = SHAPES.index(shape)
    return [first + len(SHAPES) * k for k in range(number)]


def agree(chosen: list[int]) -> None:
    """None is wrong, most reach their end, and most of their spans are compared."""
    verdicts = {seed: attack(draw(seed), sampled=False) for seed in chosen}
    wrong = {s: v for s, v in verdicts.items() if v.label in WRONG}
    assert not wrong, wrong
    reached = [v.label == "agrees" for v in verdicts.values()]
    assert np.mean(reached) > 0.8
    # what cannot be known is not compared: that must not be most of it
    assert np.mean([v.compared for v in verdicts.values()]) > 0.7


@pytest.mark.parametrize("shape, number", [((1, 1), 10), ((2, 1), 6), ((1, 2), 4)])
def test_random_systems(shape, number):
    agree(seeds(shape, number))


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_more_random_systems(shape):
    agree(seeds(shape, 12))


@pytest.mark.slow
def test_impacts_in_no_time_on_two_walls():
    """The body slides on one wall into another: four impacts in no time, then flight.

    The first wall was in contact from the start, so its gap was never above 2e-16.
    """
    problem = draw(63).in_plain_units()
    verdict = judge(problem, know(problem), sampled=False)
    assert verdict.label == "agrees", verdict


@pytest.mark.parametrize("change", [{"restitution": 1 + 1e-5}, {"weight": 1 + 1e-5}])
def test_a_small_defect_is_seen(change):
    """A run of a system that differs in the fifth digit is not taken for the same."""
    problem = draw(0).in_plain_units()
    other = {name: factor * getattr(problem, name) for name, factor in change.items()}
    wrong = dataclasses.replace(problem, **other)
    assert judge(wrong, know(problem), sampled=False).label == "DISAGREES"


@pytest.mark.parametrize("result", [RESULTS.together, RESULTS.step_failed])
def test_a_refusal_without_its_reason_is_seen(monkeypatch, result):
    """A run that agrees, but claims that it could not go on."""
    problem = draw(0).in_plain_units()
    run = _attack_verdict.simulated(problem, sampled=False)
    stopped = run._replace(result=RESULTS[result])
    monkeypatch.setattr(_attack_verdict, "simulated", lambda problem: stopped)
    assert judge(problem, know(problem)).label == "MISBLAMES"


# --- the event loop itself


GRAVITY, RESTITUTION = 1.3, 0.6


def ball(**changes) -> Problem:
    """A unit mass above a wall at zero, in a uniform field."""
    zero = np.zeros(1)
    values = dict(
        mass=np.ones(1),
        stiffness=np.zeros((1, 1)),
        cubic=zero,
        damping=np.zeros((1, 1)),
        weight=np.array([-GRAVITY]),
        drive=zero,
        frequency=1.0,
        phase=0.0,
        kick=zero,
        kick_time=0.0,
        kick_width=1.0,
        normals=np.ones((1, 1)),
        offset=zero,
        wall=zero,
        wall_frequency=np.ones(1),
        wall_phase=zero,
        restitution=np.array([RESTITUTION]),
        softening=zero,
        state=np.array([1.0, 0.0]),
        resting=(),
        span=10.0,
        length=1.0,
        time=1.0,
        begin=0.0,
    )
    return Problem(**{**values, **changes})


def test_truth_of_a_ball_that_comes_to_rest():
    """Impacts and rest of a dropped ball to 1e-11."""
    fall = np.sqrt(2 / GRAVITY)
    found = motion(ball(), [1.0, 0.0], 0.0, 10.0)
    times = np.array([impact.time for impact in found.impacts])
    k = np.arange(len(times))
    exact = fall * (1 + 2 * RESTITUTION * (1 - RESTITUTION**k) / (1 - RESTITUTION))
    assert len(times) > 40 and found.reason == "" and found.end == 10.0
    np.testing.assert_allclose(times, exact, rtol=0, atol=1e-11)
    ((start, end, _),) = found.contacts
    rest = fall * (1 + RESTITUTION) / (1 - RESTITUTION)
    assert start == pytest.approx(rest, abs=1e-11) and end == np.inf


def test_truth_of_a_release_by_a_moving_wall():
    """From rest the wall is left where it falls as fast as the ball, to 1e-10."""
    amplitude, omega = 0.5, 2.5
    moving = dict(wall=np.array([amplitude]), wall_frequency=np.array([omega]))
    # at its lowest the wall presses; released where a cos(omega t - pi) = g / omega^2
    state = np.array([-amplitude, 0.0])
    problem = ball(wall_phase=np.array([np.pi]), state=state, resting=(0,), **moving)
    found = motion(problem, state, 0.0, 2.0)
    release = (np.pi - np.arccos(GRAVITY / amplitude / omega**2)) / omega
    assert found.contacts[0][:2] == pytest.approx([0.0, release], abs=1e-10)


def test_truth_of_a_narrow_force():
    """A kick of width 1e-3 on a free body moves it by its integral, to 1e-11."""
    width, push = 1e-3, 100.0
    problem = ball(
        weight=np.zeros(1),
        kick=np.array([push]),
        kick_time=5.0,
        kick_width=width,
    )
    found = motion(problem, [1.0, 0.0], 0.0, 10.0)
    speed = push * width * np.sqrt(2 * np.pi)
    at_end = [1.0 + 5.0 * speed, speed]
    np.testing.assert_allclose(found.at(np.array([10.0]))[0], at_end, rtol=1e-11)
