"""Rules of the event loop one by one, where whole motions do not tell them apart."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import BallBetweenWalls, parameters

from jaxcam import Settings
from jaxcam.hybrid import stroboscope
from jaxcam.hybrid.loop import Jet
from jaxcam.hybrid.loop._advance import _struck, _together, Plan
from jaxcam.hybrid.loop._functions import Functions
from jaxcam.hybrid.loop._loop_state import _presses, first_state
from jaxcam.hybrid.loop._release import _root, lets_go_before, opens
from jaxcam.hybrid.loop._scale import error_norm
from jaxcam.models import BouncingBall


def jet(*rates):
    return Jet(*(jnp.asarray(float(rate)) for rate in rates))


@pytest.mark.parametrize("worst", range(3))
def test_the_error_of_a_step_is_that_of_its_worst_component(worst):
    error, allowed = np.full(3, 1e-9), np.full(3, 1e-3)
    error[worst] = -7e-3
    assert float(error_norm(tuple(error), tuple(allowed))) == pytest.approx(7.0)


def test_counters_begin_at_zero():
    functions = Functions(BouncingBall().prepared(), 2)
    first = first_state(functions, jnp.asarray(0.0), (1.0, 0.0), jnp.asarray(1.0))
    counters = first.steps, first.impacts, first.chatters, first.failures
    assert [float(x) for x in counters] == [0.0] * 4
    assert first.struck == ()


def test_impacts_on_each_of_several_constraints_are_remembered():
    walls = BallBetweenWalls(**parameters(gravity=9.81, width=1.0, restitution=0.8))
    functions = Functions(walls.prepared(), 2)
    first = first_state(functions, jnp.asarray(0.0), (0.5, 0.0), jnp.asarray(1.0))
    assert [float(t) for t in first.struck] == [-np.inf, -np.inf]


def test_counted_impacts_are_those_that_happen():
    """A dropped ball: impact k at t (1 + 2 r + ... + 2 r^k), where t = sqrt(2 h / g).

    They accumulate within the seventh second, whose first one completes the chatter.
    """
    r, height = 0.9, 0.5
    ball = BouncingBall(restitution=r)
    fall = np.sqrt(2 * height / float(ball.gravity))
    times = fall * (2 * np.cumsum(r ** np.arange(100)) - 1)
    assert 6 < times[-1] < fall * (1 + r) / (1 - r) < 7
    seen = stroboscope(ball, np.array([[height, 0.0]]), 8, period=1.0)
    listed = [*np.histogram(times, np.arange(7.0))[0], 1, 0]
    np.testing.assert_array_equal(seen.hits, [listed])
    np.testing.assert_array_equal(seen.rests, [[0] * 6 + [1, 0]])
    np.testing.assert_array_equal(seen.impacts, [sum(listed)])


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    ("before", "together"), [(0.0, True), (1e-4, True), (1e-2, False), (np.inf, False)]
)
def test_two_constraints_are_hit_together(unit, before, together):
    """Within far less than a natural step, in whatever unit time is."""
    walls = BallBetweenWalls(**parameters(gravity=9.81, width=1.0, restitution=0.8))
    functions = Functions(walls.prepared(), 2)
    lane = first_state(functions, jnp.asarray(0.0), (0.5, 0.0), jnp.asarray(1.0))
    latest = 5.0 * unit
    struck = latest, latest - before * unit
    lane = lane._replace(t=latest, longest=unit, struck=struck)
    assert bool(_together(lane)) is together


@pytest.mark.parametrize(
    ("good", "lands", "hidden", "loses", "hops"),
    [
        (True, True, True, False, 4.0),
        # one that loses energy counts less
        (True, True, True, True, 3.0625),
        # a hop that can be seen ends the row
        (True, True, False, False, 0.0),
        # no impact, or one of a step that is not taken
        (True, False, True, False, 3.0),
        (False, True, True, False, 3.0),
    ],
)
def test_hidden_hops_are_counted_at_impacts_that_happen(
    good, lands, hidden, loses, hops
):
    carried = SimpleNamespace(struck=(1.0, 2.0), crowded=(3.0,))
    attempt = SimpleNamespace(
        good=good,
        lands=lands,
        strikes=lands,
        hidden=hidden,
        loses=loses,
        hit=[lands, False],
        held=(0.0, 0.0),
        t=5.0,
    )
    struck, (crowded,) = _struck(carried, attempt)
    assert [float(t) for t in struck] == [5.0 if good and lands else 1.0, 2.0]
    assert float(crowded) == hops


@pytest.mark.parametrize(
    ("acceleration", "jerk", "offset", "lets_go"),
    [
        (-1.0, 2.0, 1.0, True),
        # still pressing at the impact
        (-5.0, 2.0, 1.0, False),
        # the pull falls
        (1.0, -0.5, 1.0, False),
    ],
)
def test_release_before_an_impact(acceleration, jerk, offset, lets_go):
    found = lets_go_before(jet(0, 0, acceleration, jerk), offset, 10.0, 1e-9)
    assert bool(found) is lets_go


@pytest.mark.parametrize(("scale", "wanted"), [(1e-3, False), (1e-1, True)])
def test_a_pull_counts_by_the_gap_that_it_opens(scale, wanted):
    """Half of 1 m/s^2 times the square of the step, beside a rounding of 1e-5 m."""
    assert bool(opens(jet(0, 0, 1.0, 0), scale, 1e-5)) is wanted


@pytest.mark.parametrize(
    ("acceleration", "jerk", "tiny", "presses"),
    [
        (-1.0, 0.0, 0.0, True),
        (1.0, 0.0, 1.0, False),
        # hops of 2 a^3 / (3 j^2) = 0.0067 beside a gap that is 0.01, or 0.001
        (0.1, -0.316, 0.01, True),
        (0.1, -0.316, 0.001, False),
        # no force yet, and it grows outwards, or inwards
        (0.0, 1.0, 1.0, False),
        (0.0, -1.0, 1e-12, True),
    ],
)
def test_what_is_touched_without_velocity_presses(acceleration, jerk, tiny, presses):
    assert bool(_presses(jet(0, 0, acceleration, jerk), tiny)) is presses


def test_plan_knows_the_period_that_it_is_given():
    """Steps are at most a part of it, of the system's own (1 s) without.

    No whole rise and fall of a surface fits in, which takes half of a period.
    """
    walls = BallBetweenWalls(**parameters(gravity=9.81, width=1.0, restitution=0.8))
    table = BouncingBall(amplitude=0.02, frequency=2 * np.pi)
    zero, end = jnp.asarray(0.0), jnp.asarray(8.0)

    def longest(system, period=None):
        plan = Plan.of(system, Settings(), zero, end, period=period)
        return float(plan.longest_step)

    assert longest(walls) == np.inf
    assert longest(table) < 0.5
    assert longest(table, 2.0) == pytest.approx(2 * longest(table))
    assert longest(walls, 2.0) == pytest.approx(2 * longest(table))


def test_plan_measures_rates_by_the_length_of_the_run():
    plan = Plan.of(BouncingBall(), Settings(), jnp.asarray(1.0), jnp.asarray(5.0))
    assert float(plan.per_run) == 0.25
    empty = Plan.of(BouncingBall(), Settings(), jnp.asarray(1.0), jnp.asarray(1.0))
    assert float(empty.per_run) == 0.0


def test_root_of_a_multiplier_that_rises_through_zero():
    """The cubic through values and rates at both ends, to 1e-6 of the step."""
    draw = np.random.default_rng(0)
    for _ in range(200):
        a0, a1 = -draw.uniform(0.1, 1), draw.uniform(0.1, 1)
        s0, s1 = (a1 - a0) * (1 + draw.uniform(-0.3, 0.3, 2))
        rise = a1 - a0
        cubic = [s0 + s1 - 2 * rise, 3 * rise - 2 * s0 - s1, s0, a0]
        roots = np.roots(cubic)
        inside = (np.abs(roots.imag) < 1e-9) & (roots.real > 0) & (roots.real < 1)
        assert float(_root(a0, s0, a1, s1)) == pytest.approx(
            roots[inside].real[0], abs=1e-6
        )
