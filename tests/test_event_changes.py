"""Branches through changes of the sequence of events, located and named."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import continuation
import jaxcam
from benchmarks.first_orbit import BELT, BeltWithStop
from continuation._parameter import pick_one
from continuation.orbits._event_changes import (
    events_of,
    name_of_change,
    within_symmetry,
)
from continuation.orbits._start_of_period import moved_start
from jaxcam.filippov.modes import surface_rates
from jaxcam.hybrid import flow, HybridAutomaton, Settings, SwitchedSystem
from jaxcam.models import BouncingBall
from jaxcam.parameters import as_arrays
from jaxcam.thesis.chapter_2_dynamical_systems.figure_2_14 import sliding_events
from variational.orbits import Event


def grazing_belt() -> float:
    """Belt speed equal to the largest speed of the harmonic motion without sticking."""
    return 0.9 * 0.7 / np.hypot(1 - 0.7**2, 2 * 0.05 * 0.7)


def test_a_branch_through_grazing_and_switching_sliding():
    """Grazing-sliding to 1e-9; at switching-sliding, the lower field is tangent."""
    orbit = continuation.periodic_orbit(BELT, [0.0, 0.0], periods=1)
    found = continuation.branch(BELT, orbit, "belt", (1.0, 1.35), direction=-1)
    assert [p.kind for p in found.special] == ["grazing-sliding", "switching-sliding"]
    assert all(p.converged for p in found.special)
    first, second = (p.parameter for p in found.special)
    assert first == pytest.approx(grazing_belt(), abs=1e-9)
    system = eqx.tree_at(lambda s: s.belt, BELT, jnp.asarray(second))
    run = jaxcam.simulate(system, found.special[1].state, 0.0, float(BELT.period))
    arrives = int(np.flatnonzero(np.asarray(run.switches.direction) == 1)[0])
    state = run.switches.before[arrives]
    above, _ = surface_rates(system, run.switches.time[arrives], state)
    assert abs(float(above)) < 1e-6
    assert found.points[-1].parameter == pytest.approx(1.0)


@pytest.mark.slow
def test_a_branch_to_the_crossing_without_sliding():
    """The same three belt speeds as by bisection with simulations, to 1e-8.

    On the way, events pass through the start of the period.
    """
    orbit = continuation.periodic_orbit(BELT, [0.0, 0.0], periods=1)
    found = continuation.branch(BELT, orbit, "belt", (0.1, 1.35), direction=-1)
    kinds = ["grazing-sliding", "switching-sliding", "crossing-sliding"]
    assert [p.kind for p in found.special] == kinds
    for point in found.special:
        expected = sliding_events()[point.kind].belt
        assert point.parameter == pytest.approx(expected, abs=1e-8)
    assert found.points[-1].parameter == pytest.approx(0.1)


def test_the_events_of_a_period_do_not_depend_on_its_start():
    """A slide that begins just before or just behind the start is one slide."""
    settings = Settings(tolerance=1e-11)
    period = float(BELT.period)
    seen = []
    for belt in (0.47785, 0.47805):
        system = eqx.tree_at(lambda s: s.belt, BELT, jnp.asarray(belt))
        state = jaxcam.simulate(system, [0.0, 0.0], 0.0, 60 * period).final
        seen.append(events_of(system, state, 0.0, period, settings))
    assert [len(one) for one in seen] == [3, 3]
    assert name_of_change(*seen) is None


class TwoStops(SwitchedSystem):
    """A forced oscillator between a rigid stop and a soft one."""

    wall: float = 1.37
    omega: float = 0.8

    def switching(self, t, state):
        return state[0] - 0.5

    def branch(self, t, state, sides):
        x, v = state
        push = jnp.cos(self.omega * t) - jnp.where(sides[0] > 0, 2.0 * (x - 0.5), 0.0)
        return jnp.stack([v, push - x - 0.2 * v])

    def gap(self, t, state):
        return state[0] + self.wall

    def impact(self, t, state):
        return state.at[1].multiply(-0.7)

    @property
    def period(self):
        return 2 * jnp.pi / self.omega


@pytest.mark.slow
def test_a_branch_passes_the_grazing_of_a_rigid_stop_next_to_a_soft_one():
    """Grazing to 1e-9 from both sides, where the settled motion without the stop just
    reaches it. The flip of the orbits with an impact is true; there is no other one.
    """
    free, settings = TwoStops(wall=5.0), Settings(tolerance=1e-12)
    period = float(free.period)
    state = jaxcam.simulate(free, [0.0, 0.0], 0.0, 60 * period, settings=settings).final
    run = jaxcam.simulate(free, state, 0.0, period, settings=settings)
    times = np.linspace(0.0, period, 1001)
    for _ in range(3):
        lowest = times[np.argmin(np.asarray(run.at(times))[:, 0])]
        times = lowest + (times - times[500]) / 100
    grazes = -float(run.at(np.array([lowest]))[0, 0])

    one = jnp.ones(2)
    system = as_arrays(TwoStops())
    problem = continuation.SingleShooting(system, 0.0 * one[0], one, one, settings, 1)
    start = continuation.Start(problem, np.asarray(state))
    gains = continuation.branch(problem, start, "wall", (1.35, 1.37), direction=-1)
    last = gains.points[-1]
    start = continuation.Start(problem, last.state, last.parameter)
    loses = continuation.branch(problem, start, "wall", (1.35, 1.37))
    for found, kinds, impacts, word, bound in (
        (gains, ["grazing", "flip"], [0, 1], "gains", 1.35),
        (loses, ["flip", "grazing"], [1, 0], "loses", 1.37),
    ):
        assert [p.kind for p in found.special] == kinds
        assert all(p.converged for p in found.points)
        (grazing,) = found.of_kind("grazing")
        assert grazing.parameter == pytest.approx(grazes, abs=1e-9)
        assert grazing.stable is None and f"{word} an impact" in grazing.reason
        counts = [int(p.observed["impacts"]) for p in found.regular]
        assert list(dict.fromkeys(counts)) == impacts
        assert found.points[-1].parameter == pytest.approx(bound)
    flips = [found.of_kind("flip")[0].parameter for found in (gains, loses)]
    assert flips[0] == pytest.approx(flips[1], abs=1e-9)


def test_the_start_of_a_period_moves_away_from_an_impact():
    """Unknowns on the same motion, to 1e-9; away from impacts, nothing is moved."""
    settings = Settings(tolerance=1e-12)
    system = as_arrays(TwoStops(wall=1.2))
    period = float(system.period)
    state = jaxcam.simulate(system, [0.0, 0.0], 0.0, 60 * period, settings=settings)
    run = jaxcam.simulate(system, state.final, 0.0, period, settings=settings)
    hits = np.asarray(run.impacts.time)[: int(run.impacts.count)]
    assert len(hits)
    one, leaf = jnp.ones(2), pick_one("wall", system)[0]
    for early, moves in ((1e-3, True), (0.05, False)):
        # nothing but the impact happens between these times
        phase = float(hits[0]) / period - early
        start = run.at(np.array([phase * period]))[0] if phase > 0 else None
        assert start is not None
        problem = continuation.SingleShooting(
            system, jnp.asarray(phase), one, one, settings, 1
        )
        z = np.append(start, 1.2)
        found = problem.restated(leaf, z, z)
        assert (found is not None) == moves
        if found is None:
            continue
        moved, there, chord = found
        assert chord is not None and np.max(np.abs(chord)) == 0
        begin, end = phase * period, (phase + float(moved.shift)) * period
        later = jaxcam.simulate(system, start, begin, end, settings=settings).final
        np.testing.assert_allclose(there[:-1], later, atol=1e-9)
        again = problem.with_signature(moved.signature)
        assert float(again.shift) == float(moved.shift)
        assert moved.representation.family != problem.representation.family
        # the states to store are those at the phase at which the branch began
        stored = moved.stored({}, there[:-1])["stroboscopic"]
        assert stored.shape == (1, 2)
        np.testing.assert_allclose(
            stored[0],
            jaxcam.simulate(system, start, begin, begin + period).final,
            atol=1e-7,
        )


@pytest.mark.slow
def test_a_belt_oscillator_passes_the_grazing_of_its_stop():
    """Grazing where the motion without the stop reaches it, to 1e-9; an impact passes
    through the start of the period; the end is the motion to which simulations
    converge, to 1e-8.
    """
    free, settings = BeltWithStop(stop=5.0), Settings(tolerance=1e-12)
    period = float(free.period)
    state = jaxcam.simulate(free, [0.0, 0.0], 0.0, 60 * period, settings=settings).final
    run = jaxcam.simulate(free, state, 0.0, period, settings=settings)
    times = np.linspace(0.0, period, 1001)
    for _ in range(3):
        highest = times[np.argmax(np.asarray(run.at(times))[:, 0])]
        times = highest + (times - times[500]) / 100
    grazes = float(run.at(np.array([highest]))[0, 0])

    orbit = continuation.periodic_orbit(BeltWithStop(), state, periods=1)
    found = continuation.branch(
        BeltWithStop(), orbit, "stop", (1.9, 2.15), direction=-1
    )
    kinds = [p.kind for p in found.special]
    assert kinds == ["grazing", "switching-sliding", "flip"]
    assert found.special[0].parameter == pytest.approx(grazes, abs=1e-9)
    last = found.points[-1]
    assert last.parameter == pytest.approx(1.9) and "shift" in last.signature
    settled = jaxcam.simulate(BeltWithStop(stop=1.9), [0.0, 0.0], 0.0, 100 * period)
    np.testing.assert_allclose(
        last.observed["stroboscopic"][0], settled.final, atol=1e-8
    )


def _moved(system, period, time, state, leaf=0):
    """The problem after its start has been moved, or None, and the new start (s)."""
    system = as_arrays(system)
    problem = continuation.SingleShooting(
        system,
        jnp.asarray(time / period),
        jnp.ones(len(state)),
        jnp.ones(len(state)),
        Settings(tolerance=1e-12),
        1,
    )
    number = float(jax.tree.leaves(system)[leaf])
    found = moved_start(problem, leaf, np.append(state, number), None)
    if found is None:
        return None, time
    return found, time + float(found[0].shift) * period


class Sticking(jaxcam.HybridSystem):
    """An oscillator that is forced against a stop and rests there."""

    wall: float = -0.6

    @property
    def period(self):
        return 2 * jnp.pi / 2.8

    def vector_field(self, t, state):
        return jnp.stack([state[1], jnp.cos(2.8 * t) - state[0]])

    def gap(self, t, state):
        return self.wall - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -0.3 * state[1]])


@pytest.mark.parametrize(("time", "moves"), [(0.5, True), (0.79, True), (1.5, False)])
def test_the_start_of_a_period_moves_out_of_a_contact(time, moves):
    """In contact from 0.198 to 0.791 s; the new start is in flight, on the same motion
    to 1e-9.
    """
    system = Sticking()
    period = 2 * np.pi / 2.8
    far = jaxcam.simulate(system, [-1.1, 0.0], 0.0, 60 * period + time)
    found, later = _moved(system, period, time, far.final)
    assert (found is not None) == moves
    if found is None:
        return
    again = jaxcam.simulate(system, far.final, time, later, tolerance=1e-12).final
    np.testing.assert_allclose(found[1][:-1], again, atol=1e-9)
    assert 0.8 < later % period < period + 0.19
    assert float(system.gap(later, again)) > 1e-3


class Triangle(HybridAutomaton):
    """Up and down between -1 and 1 at unit speed; a motion starts upwards."""

    modes = ("up", "down")
    transitions = (("up", "down"), ("down", "up"))
    top: float = 1.0

    @property
    def period(self):
        return 4.0 * self.top

    def fields(self, t, state, sides):
        return jnp.stack([jnp.ones(1), -jnp.ones(1)])

    def guards(self, t, state):
        return jnp.stack([self.top - state[0], self.top + state[0]])


def test_the_start_of_a_period_moves_to_the_mode_in_which_a_motion_starts():
    """The longest interval without a transition is downwards, where none can start."""
    found, later = _moved(Triangle(), 4.0, 0.0, np.array([0.99]))
    assert found is not None
    # upwards from 2.01 s on
    assert later == pytest.approx((2.01 + 4.0) / 2, abs=1e-9)
    assert float(found[1][0]) == pytest.approx(later - 3.01, abs=1e-9)


def _sequence(*kinds):
    """Events a second apart; a number is the time since the last one."""
    time, found = 0.0, []
    for kind in kinds:
        if isinstance(kind, float):
            time += kind - 1.0
        else:
            time += 1.0
            found.append((time, Event(kind, 0)))
    return found


@pytest.mark.parametrize(
    ("before", "after", "name"),
    [
        (["impact"], ["impact", "impact"], "grazing"),
        (["cross", "cross"], [], "grazing"),
        ([], ["slide", 0.1, "leave"], "grazing-sliding"),
        (["slide", "leave"], ["cross", "slide", "leave"], "switching-sliding"),
        (["cross", "cross"], ["cross", "slide", 0.1, "leave"], "crossing-sliding"),
        (
            ["slide", "leave"],
            ["slide", "leave", 0.1, "slide", "leave"],
            "adding-sliding",
        ),
        (["cross", "slide", "leave"], ["slide", "leave", "cross"], None),
        (["impact"], ["stick", "release"], "change of events"),
        # sliding that begins just before an impact ends it, or long before
        (["cross", "impact"], ["cross", "slide", 1e-5, "impact"], "corner collision"),
        (["cross", "impact"], ["cross", "slide", "impact"], "change of events"),
    ],
)
def test_names_of_changes(before, after, name):
    """In both directions."""
    first, second = _sequence(*before), _sequence(*after)
    assert name_of_change(first, second) == name
    assert name_of_change(second, first) == name


@pytest.mark.parametrize("times", [(0.5, 2.5), (0.5, 2.4)])
def test_changes_of_symmetric_orbits_are_named_like_others(times):
    """Two crossings half a period apart that begin to slide, and two that do not: only
    the former is the same change twice.
    """
    event = Event("cross", 0)
    before = [(time, event) for time in times]
    after = [
        (time + late, Event(kind, 0))
        for time in times
        for late, kind in ((0.0, "slide"), (1e-6, "leave"))
    ]
    name = name_of_change(*within_symmetry(before, after, 4.0))
    symmetric = times[1] - times[0] == 2.0
    assert name == ("crossing-sliding" if symmetric else "change of events")


def test_the_impacts_of_complete_chatter_are_one_event():
    """Of a ball that bounces, rests, and has bounced once before a breakpoint."""
    ball = BouncingBall(gravity=9.81, restitution=0.5)
    run = flow(ball, jnp.array([1.0, 0.0]), 0.0, 3.0)
    assert float(run.events.contacts) == 1.0
    assert float(run.events.impacts) == 0.0
    assert float(run.impacts) > 3.0
    early = flow(ball, jnp.array([1.0, 0.0]), 0.0, 1.0)
    assert (float(early.events.impacts), float(early.events.contacts)) == (2.0, 0.0)


class TwoThresholds(SwitchedSystem):
    """A forced linear oscillator that crosses thresholds of position and velocity."""

    amplitude: float = 1.0
    omega: float = 0.8
    damping: float = 0.1

    def switching(self, t, state):
        return jnp.stack([state[0] - 0.5, state[1] - 0.6])

    def branch(self, t, state, sides):
        force = self.amplitude * jnp.cos(self.omega * t)
        return jnp.stack([state[1], force - state[0] - 2 * self.damping * state[1]])

    @property
    def period(self):
        return 2 * jnp.pi / self.omega


def test_an_orbit_through_the_corner_of_two_surfaces_is_located():
    """Position 0.5 and velocity 0.6 are reached at the same time if the amplitude of
    the response is hypot(0.5, 0.6 / omega); to 1e-8.
    """
    system = TwoThresholds()
    orbit = continuation.periodic_orbit(system)
    found = continuation.branch(system, orbit, "amplitude", (0.2, 1.1), direction=-1)
    omega = 0.8
    gain = np.hypot(1 - omega**2, 2 * 0.1 * omega)
    expected = gain * np.hypot(0.5, 0.6 / omega)
    corners = [p for p in found.special if p.kind == "corner collision"]
    assert [p.kind for p in found.special].count("change of events") == 0
    np.testing.assert_allclose([p.parameter for p in corners], [expected], atol=1e-8)
    # at a smaller amplitude, the threshold of the velocity is not reached
    others = [p.parameter for p in found.special if p.kind == "grazing"]
    np.testing.assert_allclose(others, [gain * 0.6 / omega], atol=1e-8)


class Capsule(SwitchedSystem):
    """A capsule with dry friction on the ground, driven by a mass that strikes a stop
    inside (Y. Liu et al., Int. J. Mech. Sci. 66 (2013)): relative position of the mass,
    its velocity, and that of the capsule.
    """

    state_names = ("relative", "mass", "capsule")
    friction: float = 0.8

    @property
    def period(self):
        return 2 * jnp.pi / 1.1

    def switching(self, t, state):
        return state[2]

    def branch(self, t, state, sides):
        spring = state[0] + 0.1 * (state[1] - state[2])
        push = 1.6 * jnp.cos(1.1 * t) - spring
        ground = (spring - self.friction * sides[0]) / 2.0
        return jnp.stack([state[1] - state[2], push, ground])

    def gap(self, t, state):
        return 0.2 - state[0]

    def impact(self, t, state):
        push = 1.6 * (state[1] - state[2]) / 3.0
        return jnp.stack([state[0], state[1] - 2.0 * push, state[2] + push])


@pytest.mark.slow
def test_changes_of_a_capsule_that_sticks_at_the_start_of_the_period():
    """The velocity at the start is zero to rounding. The capsule slips between two
    sticking phases up to the first friction, and an impact ends its slip before it
    would stick at the second: simulations on both sides of each have these events.
    """
    for bounds, kind, before, after in [
        ((2.1, 2.2), "adding-sliding", 2, 1),
        ((0.28, 0.32), "corner collision", 1, 0),
    ]:
        system = Capsule(bounds[0])
        orbit = continuation.periodic_orbit(system)
        found = continuation.branch(system, orbit, "friction", bounds)
        assert [point.kind for point in found.special] == [kind]
        at = found.special[0].parameter
        name = "slide" if kind == "adding-sliding" else "leave"
        numbers = []
        for one in (at - 1e-3, at + 1e-3):
            there = continuation.periodic_orbit(Capsule(one), orbit.state)
            numbers.append(sum(event.kind == name for event in there.signature))
        assert numbers == [before, after]


class Undefined(jaxcam.HybridSystem):
    """Its force is not a number at rest at the origin."""

    @property
    def period(self):
        return 2 * jnp.pi

    def vector_field(self, t, state):
        return jnp.stack([state[1], jnp.cos(t) - jnp.log(state[0] - 1.0)])


def test_the_reason_why_no_orbit_was_reached_is_said():
    with pytest.raises(ValueError, match=r"started at \(0, 0\): The vector field, gap"):
        continuation.periodic_orbit(Undefined())
