"""Hybrid automata: named modes, transitions with guards and resets."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from typer.testing import CliRunner

import continuation
import jaxcam
import variational
from jaxcam.cli import app
from jaxcam.discrepancy.terms import system_with_terms
from jaxcam.hybrid import flow, HybridAutomaton, Settings, SwitchedSystem
from jaxcam.models import SpringMassRunner


EXACT = Settings(tolerance=1e-12)


class Thermostat(HybridAutomaton):
    modes = ("heating", "cooling")
    transitions = (("heating", "cooling"), ("cooling", "heating"))
    warm: float = 22.0
    cold: float = 18.0

    def fields(self, t, state, sides):
        return jnp.stack([30.0 - state, 10.0 - state])

    def guards(self, t, state):
        return jnp.stack([self.warm - state[0], state[0] - self.cold])


class Belt(HybridAutomaton):
    """A block on a belt; its three modes state dry friction with a breakaway force."""

    modes = ("slower", "sticks", "faster")
    transitions = (
        ("slower", "sticks"),
        ("faster", "sticks"),
        ("sticks", "slower"),
        ("sticks", "faster"),
    )
    friction: float = 0.4
    belt: float = 0.3
    static: float = 0.6

    def fields(self, t, state, sides):
        x, v = state
        slips = [jnp.stack([v, -x + self.friction]), jnp.stack([v, -x - self.friction])]
        return jnp.stack([slips[0], jnp.stack([self.belt, 0.0 * v]), slips[1]])

    def guards(self, t, state):
        x, v = state
        return jnp.stack(
            [self.belt - v, v - self.belt, self.static - x, self.static + x]
        )

    def start_mode(self, t, state):
        return jnp.asarray(1)


class Friction(SwitchedSystem):
    """The same block, with sliding along the surface of zero slip velocity."""

    def switching(self, t, state):
        return state[1] - 0.3

    def branch(self, t, state, sides):
        return jnp.stack([state[1], -state[0] - 0.4 * sides[0]])

    @property
    def holding(self):
        return 1.5


class Linear(HybridAutomaton):
    """Four modes with linear fields; all transitions have affine guards and resets."""

    modes = ("a", "b", "c", "d")
    transitions = (
        ("a", "b"),
        ("b", "c"),
        ("c", "d"),
        ("d", "a"),
        ("b", "d"),
        ("c", "a"),
    )
    matrices: jax.Array
    normals: jax.Array
    levels: jax.Array
    jumps: jax.Array

    def fields(self, t, state, sides):
        return self.matrices @ state

    def guards(self, t, state):
        return self.levels - self.normals @ state

    def resets(self, t, state):
        return 0.2 * state[None] + self.jumps


def random_linear(seed):
    draw = np.random.default_rng(seed)
    turn = np.array([[0.6, 2.0, 0.0], [-2.0, 0.6, 0.3], [0.5, 0.0, 0.2]])
    matrices = draw.uniform(0.7, 2.0, (4, 1, 1)) * (turn + draw.normal(0, 0.3, (3, 3)))
    return Linear(
        *map(
            jnp.asarray,
            (
                matrices,
                draw.normal(size=(6, 3)),
                draw.uniform(0.5, 1.5, 6),
                draw.normal(0, 0.2, (6, 3)),
            ),
        )
    )


def transitions_by_scipy(system, state, end):
    """Return times and numbers of the transitions, and the final state, by solve_ivp
    from one transition to the next.
    """
    matrices, normals, levels, jumps = (
        np.asarray(part)
        for part in (system.matrices, system.normals, system.levels, system.jumps)
    )
    pairs = [tuple(map(system.modes.index, pair)) for pair in system.transitions]
    t, x, mode, found = 0.0, np.asarray(state), 0, []
    while t < end and len(found) < 60:
        own = [k for k, (before, _) in enumerate(pairs) if before == mode]
        now = [k for k in own if levels[k] - normals[k] @ x < 0]
        if now:
            k = now[0]
        else:

            def watch(k):
                def guard(s, y):
                    return levels[k] - normals[k] @ y

                guard.terminal, guard.direction = True, -1
                return guard

            made = solve_ivp(
                lambda s, y: matrices[mode] @ y,
                (t, end),
                x,
                "DOP853",
                events=[watch(k) for k in own],
                rtol=1e-13,
                atol=1e-13,
                max_step=0.02,
            )
            t, x = made.t[-1], made.y[:, -1]
            hits = [k for k, times in zip(own, made.t_events) if len(times)]
            if not hits:
                break
            k = hits[0]
        found.append((t, k))
        x, mode = 0.2 * x + jumps[k], pairs[k][1]
    return found, x


def test_the_times_of_a_thermostat_are_those_of_its_closed_form():
    run = jaxcam.simulate(Thermostat(), [20.0], 0.0, 3.0, settings=EXACT)
    first, later = np.log(10 / 8), np.log(12 / 8)
    expected = first + later * np.arange(7)
    np.testing.assert_allclose(run.switches.time, expected, rtol=1e-12)
    assert run.modes.names() == ["heating", "cooling"] * 4
    cooled = later * 3 + 3.0 - expected[-1]
    np.testing.assert_allclose(run.modes.time_in("cooling"), cooled, rtol=1e-12)
    # every guard falls to zero, whatever the sides are
    assert np.asarray(run.switches.direction).tolist() == [-1.0] * 7


def test_three_modes_of_a_belt_agree_with_sliding_of_a_switched_system():
    """Times to 1e-10: the two systems state the same friction in different ways."""
    automaton = jaxcam.simulate(Belt(), [0.0, 0.3], 0.0, 30.0)
    switched = jaxcam.simulate(Friction(), [0.0, 0.3], 0.0, 30.0)
    assert int(automaton.switches.count) == int(switched.switches.count) == 9
    np.testing.assert_allclose(
        automaton.switches.time, switched.switches.time, atol=1e-10
    )
    np.testing.assert_allclose(automaton.final, switched.final, atol=1e-10)


@pytest.mark.parametrize("seed", range(12))
def test_random_automata_agree_with_scipy(seed):
    """The order of transitions, and their times to 1e-9."""
    system, start = random_linear(seed), [0.3, 0.2, -0.1]
    found, last = transitions_by_scipy(system, start, 6.0)
    run = jaxcam.simulate(system, start, 0.0, 6.0, settings=EXACT)
    assert bool(run.successful)
    which = np.asarray(run.switches.surface)[: int(run.switches.count)].tolist()
    assert which == [k for _, k in found]
    times = np.asarray(run.switches.time)[: len(found)]
    np.testing.assert_allclose(times, [t for t, _ in found], atol=1e-9)
    np.testing.assert_allclose(run.final, last, atol=1e-8)


def eventful():
    """The first random automaton with at least four transitions in six seconds."""
    for seed in range(100):
        system = random_linear(seed)
        run = jaxcam.simulate(system, [0.3, 0.2, -0.1], 0.0, 6.0, settings=EXACT)
        apart = np.diff(np.asarray(run.switches.time)[: int(run.switches.count)])
        if bool(run.successful) and len(apart) >= 3 and np.all(apart > 0.05):
            return system, run
    raise AssertionError("no random automaton has four transitions")


def test_derivatives_contain_the_saltation_of_every_transition():
    """Products of matrix exponentials and saltation matrices to 1e-9, central
    differences to 1e-6.
    """
    system, run = eventful()
    x = jnp.array([0.3, 0.2, -0.1])

    def end(state):
        return flow(system, state, 0.0, 6.0, settings=EXACT).state

    found = np.asarray(jax.jacfwd(end)(x))
    step = 1e-6 * np.eye(3)
    central = [(end(x + h) - end(x - h)) / 2e-6 for h in step]
    np.testing.assert_allclose(found.T, central, atol=1e-6 * np.abs(found).max())

    expected, t, mode = np.eye(3), 0.0, 0
    steps, switches = run.steps, run.switches
    for k in range(int(switches.count)):
        time, which = float(switches.time[k]), int(switches.surface[k])
        expected = expm(np.asarray(system.matrices[mode]) * (time - t)) @ expected
        before = int(np.searchsorted(steps.time, time)) - 1
        salted = variational.switching_saltation(
            system, time, switches.before[k], steps.sides[before], which
        )
        expected = np.asarray(salted) @ expected
        t, mode = time, system.modes.index(system.transitions[which][1])
    expected = expm(np.asarray(system.matrices[mode]) * (6.0 - t)) @ expected
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_a_batch_agrees_with_single_motions():
    starts = jnp.array([[0.0, 0.3], [0.2, 0.3], [-0.5, 0.3]])
    whole = jax.vmap(lambda x: flow(Belt(), x, 0.0, 20.0).state)(starts)
    single = jnp.stack([flow(Belt(), x, 0.0, 20.0).state for x in starts])
    np.testing.assert_allclose(whole, single, atol=1e-12)
    seen = jaxcam.hybrid.stroboscope(Belt(), starts, 4, period=5.0)
    np.testing.assert_allclose(seen.states[:, -1], single, atol=1e-9)


def test_transitions_that_are_due_follow_each_other_at_once():
    class Chain(HybridAutomaton):
        modes = ("one", "two", "three")
        transitions = (("one", "two"), ("two", "three"))
        threshold: float = 1.0

        def fields(self, t, state, sides):
            return jnp.stack([1.0 + 0 * state, 0 * state, -2.0 + 0 * state])

        def guards(self, t, state):
            return jnp.stack([self.threshold - state[0], 0.5 - state[0]])

    run = jaxcam.simulate(Chain(), [0.0], 0.0, 2.0)
    assert run.modes.names() == ["one", "two", "three"]
    np.testing.assert_allclose(run.modes.start, [0, 1, 1], atol=1e-14)
    np.testing.assert_allclose(run.final, [-1.0], atol=1e-12)
    # a start beyond the first threshold leaves its mode at once
    late = jaxcam.simulate(Chain(), [3.0], 0.0, 1.0)
    np.testing.assert_allclose(late.modes.end, [0, 0, 1], atol=1e-14)
    # and so does a start exactly at it
    at = jaxcam.simulate(Chain(), [1.0], 0.0, 1.0)
    np.testing.assert_allclose(at.final, [-1.0], atol=1e-12)


class Braked(HybridAutomaton):
    """A block with dry friction that grows when a brake engages at x = 1."""

    modes = ("free", "braked")
    transitions = (("free", "braked"),)
    free: float = 0.5
    braked: float = 2.0

    def fields(self, t, state, sides):
        v = state[1]
        return jnp.stack(
            [jnp.stack([v, -mu * sides[0]]) for mu in (self.free, self.braked)]
        )

    def guards(self, t, state):
        return jnp.stack([1.0 - state[0]])

    def surfaces(self, t, state):
        return state[1:]


def test_friction_acts_in_every_mode():
    """v^2 falls by 2 mu x in each mode, and the block then sticks; to 1e-10."""
    run = jaxcam.simulate(Braked(), [0.0, 2.0], 0.0, 4.0)
    speed = np.sqrt(4.0 - 2 * 0.5)
    stop = 1.0 + speed**2 / (2 * 2.0)
    np.testing.assert_allclose(run.final, [stop, 0.0], atol=1e-10)
    engaged = (2.0 - speed) / 0.5
    np.testing.assert_allclose(
        run.switches.time, [engaged, engaged + speed / 2.0], atol=1e-10
    )
    np.testing.assert_allclose(run.sliding(1)[0], [engaged + speed / 2.0, 4.0])


def test_impacts_and_modes_in_one_system():
    """A ball that loses its weight below 0.1 m: closed-form times to 1e-10."""

    class Ball(HybridAutomaton):
        modes = ("up", "down", "weightless")
        transitions = (("up", "down"), ("down", "up"), ("down", "weightless"))
        restitution: float = 0.8

        def fields(self, t, state, sides):
            falls = jnp.stack([state[1], -10.0 + 0 * state[0]])
            return jnp.stack([falls, falls, jnp.stack([state[1], 0 * state[0]])])

        def guards(self, t, state):
            return jnp.stack([state[1], -state[1], state[0] - 0.1])

        def gap(self, t, state):
            return state[0]

        def impact(self, t, state):
            return jnp.stack([state[0], -self.restitution * state[1]])

        def start_mode(self, t, state):
            return jnp.asarray(1)

    # falls from 0.05 m, which is already below the threshold
    run = jaxcam.simulate(Ball(), [0.05, 0.0], 0.0, 0.5)
    assert run.modes.names()[:2] == ["down", "weightless"]
    # falls from 1 m: weightless from 0.1 m on, with the speed reached there
    run = jaxcam.simulate(Ball(), [1.0, 0.0], 0.0, 1.0)
    time, speed = np.sqrt(2 * 0.9 / 10), np.sqrt(2 * 0.9 * 10)
    hit = time + 0.1 / speed
    np.testing.assert_allclose(run.impacts.time, [hit], atol=1e-10)
    np.testing.assert_allclose(run.final[0], 0.8 * speed * (1 - hit), atol=1e-10)


def test_a_stick_slip_cycle_of_three_modes_is_continued():
    """The period of the cycle of the same block as a `SwitchedSystem`, to 1e-8."""
    orbit = continuation.periodic_orbit(Belt(), [0.4, 0.3], period=6.0)
    other = continuation.periodic_orbit(Friction(), [0.4, 0.3], period=6.0)
    np.testing.assert_allclose(orbit.period, other.period, atol=1e-8)
    found = continuation.branch(Belt(), orbit, "belt", (0.25, 0.35))
    end = found.points[-1]
    again = continuation.periodic_orbit(
        Belt(belt=float(end.parameter)), [0.4, float(end.parameter)], period=6.0
    )
    np.testing.assert_allclose(end.observed["period"], again.period, atol=1e-8)
    # one exponent is zero; the other is minus infinity, because the belt stops the slip
    multipliers = np.sort(np.abs(orbit.multipliers))
    np.testing.assert_allclose(multipliers, [0.0, 1.0], atol=1e-8)


def test_an_orbit_must_return_to_its_mode():
    # in mode "cooling", the motion passes the state at which it was in "heating"
    there = 20.0
    late = float(np.log(10 / 8) + np.log(12 / 10))
    with pytest.raises(ValueError, match="is in mode cooling, but it started in heat"):
        variational.orbit_of(Thermostat(), [there], period=late)


def test_a_runner_settles_to_a_steady_gait():
    """At 67 and 68 degrees, to 1e-6 m, with the energy constant to 1e-8; at 66 degrees,
    every one of the first steps is higher than the last.
    """
    start = jnp.array([0.0, 1.0, 5.0, 0.0])
    for degrees in (67.0, 68.0):
        system = SpringMassRunner(attack=np.radians(degrees))
        run = jaxcam.simulate(system, start, 0.0, 40.0)
        apex = np.asarray(run.switches.surface)[: int(run.switches.count)] == 2
        states = np.asarray(run.switches.after)[: len(apex)][apex]
        assert abs(states[-1, 1] - states[-2, 1]) < 1e-6
        energy = [float(system.energy(x)) for x in states]
        np.testing.assert_allclose(energy, float(system.energy(start)), rtol=1e-8)
    run = jaxcam.simulate(SpringMassRunner(attack=np.radians(66.0)), start, 0.0, 5.0)
    apex = np.asarray(run.switches.surface)[: int(run.switches.count)] == 2
    heights = np.asarray(run.switches.after)[: len(apex)][apex][:5, 1]
    assert np.all(np.diff(heights) > 0)


def test_terms_are_added_in_every_mode():
    plain = jaxcam.simulate(Belt(), [0.0, 0.3], 0.0, 9.0)
    same = jaxcam.simulate(system_with_terms(Belt(), ()), [0.0, 0.3], 0.0, 9.0)
    assert same.modes.names() == plain.modes.names() == ["sticks", "slower"] * 2
    np.testing.assert_allclose(same.switches.time, plain.switches.time, atol=1e-12)


def test_mistakes_are_explained():
    def refused(match, **changed):
        wrong = type("Wrong", (Belt,), changed)
        with pytest.raises(ValueError, match=match):
            jaxcam.simulate(wrong(), [0.0, 0.3], 0.0, 1.0)

    refused("name the modes slow,", transitions=(("slower", "slow"),))
    refused("begins or ends in idle", modes=(*Belt.modes, "idle"))
    refused(
        "leads from sticks to sticks",
        transitions=(*Belt.transitions[1:], ("sticks", "sticks"), ("slower", "faster")),
    )
    refused(
        r"guards of Wrong returns shape \(1,\); return \(4,\), one row for each tran",
        guards=lambda self, t, state: state[:1],
    )
    refused(
        r"fields of Wrong returns shape \(2,\); return \(3, 2\), one row for each mode",
        fields=lambda self, t, state, sides: state,
    )
    run = jaxcam.simulate(Belt(), [0.0, 0.3], 0.0, 1.0)
    with pytest.raises(ValueError, match="there is no mode slips; the modes are slow"):
        run.modes.time_in("slips")
    other = jaxcam.simulate(Friction(), [0.0, 0.3], 0.0, 1.0)
    with pytest.raises(ValueError, match="Friction has no named modes; derive it from"):
        _ = other.modes


SWITCH = """
import jax.numpy as jnp
from jaxcam.hybrid import HybridAutomaton


class Hoist(HybridAutomaton):
    state_names = ("depth", "speed")
    modes = ("lowers", "brakes")
    transitions = (("lowers", "brakes"), ("brakes", "lowers"))
    fastest: float = 2.0

    def fields(self, t, state, sides):
        return jnp.stack([jnp.stack([state[1], a + 0 * t]) for a in (0.5, -4.0)])

    def guards(self, t, state):
        return jnp.stack([self.fastest - state[1], state[1]])
"""


@pytest.mark.usefixtures("unchecked_types")
def test_the_command_writes_switches_and_modes(tmp_path):
    (tmp_path / "hoist.py").write_text(SWITCH)
    words = ["simulate", f"--system={tmp_path / 'hoist.py'}:Hoist", "--state=0,0"]
    said = CliRunner().invoke(app, [*words, "--t1=4.75", "--json=-"])
    assert said.exit_code == 0, said.output
    found = json.loads(said.stdout)
    assert found["modes"]["name"] == ["lowers", "brakes", "lowers"]
    np.testing.assert_allclose(found["modes"]["end"], [4.0, 4.5, 4.75], atol=1e-10)
    assert found["switches"]["surface"] == [0, 1]
    assert "in mode lowers at the end" in found["sentence"]
