"""Crossings of switching surfaces: times, states and order, against closed forms."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from switched_systems import bilinear_motion, integrated, random_affine

import jaxcam
from jaxcam.hybrid import flow, RESULTS, Settings, stroboscope, SwitchedSystem
from jaxcam.models import (
    BilinearOscillator,
    DryFrictionOscillator,
    GearBacklash,
    load_system,
    save_system,
)


SHARP = Settings(tolerance=1e-13)


@eqx.filter_jit
def _end(system, state, t1, settings):
    return flow(system, state, 0.0, t1, settings=settings)


def test_free_bilinear_oscillator_has_two_half_periods():
    """47 crossings, pi / sqrt(k) on one side of the stop and pi on the other."""
    system = BilinearOscillator(stiffness=9.0)
    run = jaxcam.simulate(system, [0.0, 1.0], 0.0, 100.0, settings=SHARP)
    stiff, whole = np.pi / 3, np.pi * 4 / 3
    turns = whole * np.arange(24)
    wanted = np.sort(np.concatenate([turns + stiff, turns + whole]))[:47]
    assert run.successful and int(run.switches.count) == 47
    assert np.max(np.abs(run.switches.time - wanted)) < 1e-10
    assert np.all(run.switches.direction == np.resize([-1.0, 1.0], 47))
    assert np.max(np.abs(run.switches.after[:, 0])) < 1e-10
    assert np.array_equal(run.switches.before, run.switches.after)
    assert int(run.impacts.count) == 0 and int(run.contacts.count) == 0
    # inside a piece, after the tenth period
    t = 10 * whole + np.array([0.3, stiff + 0.4])
    exact = np.stack([np.sin(0.9) / 3, -np.sin(0.4)])
    assert np.max(np.abs(run.at(t)[:, 0] - exact)) < 1e-10


def test_forced_bilinear_oscillator_is_piecewise_exact():
    system = BilinearOscillator(
        stiffness=16.0, stop=0.2, damping=0.05, amplitude=1.0, omega=1.7
    )
    times, end = bilinear_motion(system, [0.5, 0.0], 60.0)
    run = jaxcam.simulate(system, [0.5, 0.0], 0.0, 60.0, settings=SHARP)
    assert int(run.switches.count) == len(times) > 20
    assert np.max(np.abs(run.switches.time - times)) < 1e-9
    assert np.max(np.abs(run.final - end)) < 1e-9


def test_gear_crosses_its_backlash_and_swings_on_its_teeth():
    """Free and undamped: 2 clearance / v through the backlash, pi on the teeth."""
    system = GearBacklash(clearance=0.7, load=0.0)
    run = jaxcam.simulate(system, [0.0, 1.3], 0.0, 60.0, settings=SHARP)
    across = 1.4 / 1.3
    gaps = np.resize([np.pi, across], int(run.switches.count) - 1)
    wanted = 0.7 / 1.3 + np.concatenate([[0.0], np.cumsum(gaps)])
    assert int(run.switches.count) > 25
    assert np.max(np.abs(run.switches.time - wanted)) < 1e-9
    surfaces = np.resize([0, 0, 1, 1], len(wanted))
    assert np.array_equal(run.switches.surface, surfaces)
    table = str(run.switches)
    assert table.startswith(f"switches: {len(wanted)}") and "falling" in table
    assert f"switches: {len(wanted)}" in str(run)


@settings(max_examples=25)
@given(
    st.floats(0.05, 50.0), st.integers(-300, 300), st.integers(-300, 300).filter(bool)
)
def test_free_motions_return_after_their_period(stiffness, x, v):
    """With the stop at zero every motion has the same period."""
    system, state = BilinearOscillator(stiffness=stiffness), np.array([x, v]) / 100
    period = np.pi * (1 + 1 / np.sqrt(stiffness))
    end = _end(system, jnp.asarray(state), jnp.asarray(period), SHARP)
    assert int(end.code) == 0
    assert np.max(np.abs(end.state - state)) < 1e-11


@pytest.mark.parametrize("jump", [0.0, 0.3])
def test_random_systems_against_another_integrator(jump):
    """Two surfaces, three states: no event lost, times to 1e-9, sliding included."""
    rng, crossings, slides = np.random.default_rng(28), 0, 0
    for _ in range(60):
        system, state = random_affine(rng, jump=jump), rng.normal(size=3)
        times, which, kinds, end = integrated(system, state, 4.0)
        run = jaxcam.simulate(system, state, 0.0, 4.0, settings=SHARP)
        assert RESULTS[run.code] == ""
        assert np.array_equal(run.switches.surface, which)
        assert np.array_equal(run.switches.kind, kinds)
        assert np.max(np.abs(run.switches.time - times), initial=0.0) < 1e-9
        assert np.max(np.abs(run.final - end)) < 1e-8
        crossings, slides = crossings + len(times), slides + np.sum(kinds == 1)
    assert crossings > 200
    assert (slides > 0) == (jump > 0)


def test_order_is_kept_at_a_corner():
    """Eighth order with steps of equal length between crossings."""
    system = BilinearOscillator(stiffness=4.0, stop=0.1, damping=0.02, amplitude=0.5)
    _, exact = bilinear_motion(system, [0.5, 0.0], 20.0)
    errors = []
    for step in (0.5, 0.25):
        loose = Settings(jnp.asarray(0.5), max_step=jnp.asarray(step))
        end = _end(system, jnp.array([0.5, 0.0]), jnp.asarray(20.0), loose)
        errors.append(float(np.max(np.abs(end.state - exact))))
    assert np.log2(errors[0] / errors[1]) > 6.5


class Relay(SwitchedSystem):
    """x' = -sgn x, with hysteresis: it swings between the two thresholds."""

    width: float = 0.0
    start: float = 1.0

    def switching(self, t, state):
        return state[0]

    def branch(self, t, state, sides):
        return jnp.stack([-sides[0], jnp.ones_like(t)])

    def sides(self, t, state):
        held = jnp.abs(state[0]) <= self.width
        sign = jnp.where(state[0] >= 0, 1.0, -1.0)
        return jnp.where(held & (self.width > 0), self.start, sign)[None]

    @property
    def hysteresis(self):
        return self.width


def test_relay_with_hysteresis():
    run = jaxcam.simulate(Relay(width=0.25, start=-1.0), [0.0, 0.0], 0.0, 10.0)
    wanted = 0.25 + 0.5 * np.arange(len(run.switches.time))
    assert len(wanted) == 20
    assert np.max(np.abs(run.switches.time - wanted)) < 1e-12
    assert np.array_equal(run.switches.direction, np.resize([1.0, -1.0], 20))
    assert np.all(run.steps.sides[:1] == -1.0)


@pytest.mark.parametrize("start", [0.5, 0.0])
def test_a_relay_without_hysteresis_slides(start):
    """Where both branches point to the surface, from the time of arrival."""
    run = jaxcam.simulate(Relay(), [start, 0.0], 0.0, 2.0)
    assert run.successful
    assert run.final[0] == 0 and abs(run.final[1] - 2) < 1e-14
    assert int(run.switches.count) == (1 if start else 0)
    assert run.steps.sides[-1, 0] == 0
    if start:
        assert abs(float(run.switches.time[0]) - start) < 1e-12
        assert run.switches.kind[0] == 1


class Accumulating(SwitchedSystem):
    """A ball between two half spaces that pull it to their plane, less strongly when it
    leaves: the crossings accumulate.
    """

    def switching(self, t, state):
        return state[0]

    def branch(self, t, state, sides):
        return jnp.stack([state[1], -sides[0] * (1.0 + 0 * t)])

    def reset(self, t, state, sides):
        return jnp.stack([state[0], 0.6 * state[1]])


def test_accumulating_crossings_end_with_a_sentence():
    run = jaxcam.simulate(Accumulating(), [0.0, 1.0], 0.0, 10.0)
    # 2 v on each side, and v falls by 0.6
    assert run.code == 7
    assert abs(float(run.steps.time[-1]) - 2.0 / 0.4) < 1e-6
    wanted = 2.0 * (1 - 0.6 ** np.arange(1, 21)) / 0.4
    assert np.max(np.abs(run.switches.time[:20] - wanted)) < 1e-9
    speed = np.abs(run.switches.after[:20, 1] / run.switches.before[:20, 1])
    assert np.max(np.abs(speed - 0.6)) < 1e-12


class Lift(SwitchedSystem):
    """A ball that bounces and rests on the floor until its weight changes sign."""

    restitution: float = 0.5
    when: float = 3.0

    def switching(self, t, state):
        return t - self.when

    def branch(self, t, state, sides):
        return jnp.stack([state[1], sides[0]])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


def test_impacts_contact_and_switches_in_one_run():
    system = Lift(when=4.5)
    run = jaxcam.simulate(system, [0.5, 0.0], 0.0, 6.0)
    # falls for 1 s with unit gravity, then bounces that last 2, 1, ... times one half
    assert abs(float(run.impacts.time[0]) - 1.0) < 1e-10
    assert int(run.contacts.count) == 1
    assert abs(float(run.contacts.start[0]) - 3.0) < 1e-6
    assert abs(float(run.contacts.end[0]) - 4.5) < 1e-9
    assert np.max(np.abs(run.switches.time - 4.5)) < 1e-9
    assert np.max(np.abs(run.final - np.array([1.125, 1.5]))) < 1e-9


class Heavier(Lift):
    """A ball that weighs more while it rises: an impact crosses the surface."""

    def switching(self, t, state):
        return state[1]

    def branch(self, t, state, sides):
        return jnp.stack([state[1], -1.0 - 0.5 * sides[0] + 0 * t])


def test_an_impact_carries_the_state_across_a_surface():
    run = jaxcam.simulate(Heavier(), [1.0, 0.0], 0.0, 3.0)
    # falls with 0.5, to speed 1, and rises with 1.5, from speed 0.5
    top = 2.0 + 0.5 / 1.5
    assert np.max(np.abs(run.switches.time[:2] - np.array([2.0, top]))) < 1e-10
    assert np.array_equal(run.switches.direction[:2], [1.0, -1.0])
    assert abs(float(run.impacts.time[0]) - 2.0) < 1e-10
    fall = np.sqrt(2 * (0.5**2 / 3.0) / 0.5)
    assert abs(float(run.impacts.time[1]) - top - fall) < 1e-10


def test_batches_and_compiled_programs_agree_with_single_runs():
    system = BilinearOscillator(stiffness=9.0, amplitude=0.4, damping=0.05, omega=0.9)
    states = jnp.array([[0.5, 0.0], [-1.0, 0.3], [0.01, -0.2], [2.0, 0.0]])

    def run(state):
        found = jaxcam.simulate(system, state, 0.0, 15.0, max_steps=256)
        return found.switches, found.steps.count, found.code

    switches, _, codes = jax.jit(jax.vmap(run))(states)
    assert np.all(codes == 0)
    period = float(system.period)
    whole = stroboscope(system, states, 2, settings=Settings())
    assert np.all(whole.code == 0) and np.all(whole.impacts == 0)
    for k, state in enumerate(states):
        alone = jaxcam.simulate(system, state, 0.0, 15.0)
        count = int(alone.switches.count)
        assert int(switches.count[k]) == count > 2
        assert np.max(np.abs(switches.time[k, :count] - alone.switches.time)) < 1e-9
        assert np.all(np.isinf(switches.time[k, count:]))
        end = _end(system, state, jnp.asarray(2 * period), Settings()).state
        assert np.max(np.abs(whole.states[k, -1] - end)) < 1e-9


def test_llvm_runs_it_or_says_so():
    system = BilinearOscillator(stiffness=9.0)
    settings = Settings(backend="auto")
    run = jaxcam.simulate(system, [0.0, 1.0], 0.0, 20.0, settings=settings)
    other = jaxcam.simulate(system, [0.0, 1.0], 0.0, 20.0)
    assert np.max(np.abs(run.switches.time - other.switches.time)) < 1e-9


def test_bad_functions_of_surfaces_are_refused():
    class Wide(Relay):
        def switching(self, t, state):
            return jnp.zeros((2, 2))

    class Sideless(Relay):
        def sides(self, t, state):
            return jnp.ones(3)

    class Resets(Relay):
        def reset(self, t, state, sides):
            return jnp.zeros(3)

    for system, words in (
        (Wide(), "switching returns shape"),
        (Sideless(), "sides returns shape"),
        (Resets(), "reset returns shape"),
        (Relay(width=-1.0), "hysteresis"),
    ):
        with pytest.raises(ValueError, match=words):
            jaxcam.simulate(system, [0.5, 0.0], 0.0, 1.0)
    with pytest.raises(ValueError, match="switching surfaces"):
        jaxcam.simulate(Relay(), [0.5, 0.0], 0.0, 1.0, engine="diffeqsolve")


def test_models_are_saved_and_read(tmp_path):
    for system in (BilinearOscillator(stiffness=3.0), GearBacklash(load=0.2)):
        save_system(system, tmp_path / "system.json")
        assert eqx.tree_equal(load_system(tmp_path / "system.json"), system)


@pytest.mark.parametrize("place", [3.0, 0.1, 1.0])
@pytest.mark.parametrize("velocity", [1e-13, -1e-13, 1e-15, -1e-17])
def test_a_velocity_of_zero_may_have_a_rounding_error(place, velocity):
    """Where the net force exceeds friction in either direction, and where the body
    sticks: as from rest, to 1e-9. A body that sticks from the start has no event there.
    """
    system = DryFrictionOscillator()
    run, known = (
        jaxcam.simulate(system, [place, v], 0.0, 3.0) for v in (velocity, 0.0)
    )
    assert run.successful, run.result
    np.testing.assert_allclose(run.final, known.final, atol=1e-9)
    sticks = place == 1.0
    assert not (sticks and np.any(np.asarray(run.switches.time) < 1e-9))
