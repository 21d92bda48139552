"""Sliding along switching surfaces: dry friction with stick, against closed forms."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import jaxcam
from jaxcam.hybrid import flow, Settings, SwitchedSystem
from jaxcam.models import DryFrictionOscillator, load_system, save_system


SHARP = Settings(tolerance=1e-13)
CROSSES, SLIDES, LEAVES = 0, 1, 2


class Rubbing(SwitchedSystem):
    """x'' + x = drive cos(omega t) - friction sgn(x' - belt), with a static limit."""

    friction: float = 0.3
    belt: float = 0.0
    drive: float = 0.0
    omega: float = 1.0
    static: float = 1.0

    def switching(self, t, state):
        del t
        return state[1] - self.belt

    def branch(self, t, state, sides):
        push = self.drive * jnp.cos(self.omega * t) - self.friction * sides[0]
        return jnp.stack([state[1], push - state[0]])

    @property
    def holding(self) -> Any:
        return self.static

    @property
    def period(self) -> Any:
        return 2 * jnp.pi / self.omega


def largest(found, expected):
    return np.max(np.abs(np.asarray(found) - np.asarray(expected)), initial=0.0)


def run_of(system, state, t1):
    found = jaxcam.simulate(system, state, 0.0, t1, settings=SHARP)
    assert found.successful
    return found


@eqx.filter_jit
def end_of(system, state, t1):
    return flow(system, state, 0.0, t1, settings=SHARP)


@pytest.mark.parametrize("x0", [2.0, -1.7, 0.85])
def test_free_oscillation_stops_in_its_dead_zone(x0):
    """Half cycles last pi and lose 2 f each; the body stops at a turning point."""
    f = 0.3
    run = run_of(Rubbing(friction=f), [x0, 0.0], 20.0)
    turns, x = [], x0
    while abs(x) > f:
        x = -(abs(x) - 2 * f) * np.sign(x)
        turns.append(x)
    wanted = np.pi * np.arange(1, len(turns) + 1)
    assert largest(run.switches.time, wanted) < 1e-11
    assert largest(run.switches.after[:, 0], np.array(turns)) < 1e-11
    assert list(run.switches.kind) == [CROSSES] * (len(turns) - 1) + [SLIDES]
    stuck = run.steps.time > wanted[-1]
    assert np.all(np.asarray(run.steps.sides[stuck]) == 0)
    assert largest(run.steps.state[stuck], np.array([turns[-1], 0])) < 1e-11
    assert largest(run.at([15.0, 19.0]), np.array([turns[-1], 0])) < 1e-11


def test_a_start_at_rest_sticks_inside_the_dead_zone_only():
    for x0, sticks in ((0.299, True), (-0.3, True), (0.301, False), (0.0, True)):
        run = run_of(Rubbing(friction=0.3), [x0, 0.0], 3.0)
        assert (run.steps.sides[0, 0] == 0) == sticks
        assert bool(jnp.all(run.final == jnp.array([x0, 0.0]))) == sticks


def by_scipy(system: Rubbing, state, t1):
    """Events (time, kind) of a body on ground at rest, by another integrator."""
    f, a, w = (float(getattr(system, n)) for n in ("friction", "drive", "omega"))
    t, x, events = 0.0, np.asarray(state, dtype=float), []
    while t < t1:
        force = a * np.cos(w * t) - x[0]
        if abs(x[1]) < 1e-12 and abs(force) <= f:
            events.append((t, SLIDES))

            def limit(s, x=x):
                return abs(a * np.cos(w * s) - x[0]) - f

            grid = t + np.linspace(1e-9, 2 * np.pi / w, 4000)
            beyond = np.flatnonzero([limit(s) > 0 for s in grid])
            if not len(beyond):
                return events, x
            t = brentq(limit, grid[beyond[0] - 1], grid[beyond[0]], xtol=1e-15)
            if t > t1:
                return events, x
            events.append((t, LEAVES))
            side = np.sign(a * np.cos(w * t) - x[0])
        else:
            side = np.sign(x[1]) if abs(x[1]) > 1e-12 else np.sign(force)
            if events or abs(x[1]) <= 1e-12:
                events.append((t, CROSSES))

        def field(s, y, side=side):
            return [y[1], a * np.cos(w * s) - y[0] - f * side]

        def turns(s, y, side=side):
            return side * y[1] + (1e-9 if s < t + 1e-6 else 0.0)

        turns.terminal, turns.direction = True, -1
        made = solve_ivp(
            field, (t, t1), x, "DOP853", events=turns, rtol=1e-13, atol=1e-14,
            max_step=0.1,
        )  # fmt: skip
        t, x = made.t[-1], made.y[:, -1]
        if made.status != 1:
            return events, x
        x = np.array([x[0], 0.0])
    return events, x


@pytest.mark.parametrize(
    ("drive", "omega", "friction"), [(1.0, 0.5, 0.6), (1.0, 0.25, 0.5), (2.0, 1.7, 0.4)]
)
def test_forced_oscillation_sticks_and_slips(drive, omega, friction):
    """Every event of forced motions against an integrator of its own."""
    system = Rubbing(friction=friction, drive=drive, omega=omega)
    run = run_of(system, [0.3, 0.5], 60.0)
    events, end = by_scipy(system, [0.3, 0.5], 60.0)
    assert list(run.switches.kind) == [kind for _, kind in events]
    assert len(events) >= 12
    wanted = np.array([t for t, _ in events])
    assert largest(run.switches.time, wanted) < 1e-9
    assert largest(run.final, end) < 1e-9
    for t, kind, (x, _) in zip(
        run.switches.time, run.switches.kind, run.switches.after, strict=True
    ):
        if kind == LEAVES:
            force = drive * np.cos(omega * t) - x
            assert abs(abs(force) - friction) < 1e-13


def test_block_on_a_belt_lets_go_at_the_limit():
    """It slips on an arc about -f, sticks at the belt's speed and leaves at x = f."""
    f, belt, x0, v0 = 0.4, 0.3, -0.9, 0.5
    run = run_of(Rubbing(friction=f, belt=belt), [x0, v0], 6.0)
    radius, phase = np.hypot(x0 + f, v0), np.arctan2(v0, x0 + f)
    first = phase - np.arcsin(belt / radius)
    x1 = -f + radius * np.cos(first - phase)
    assert list(run.switches.kind) == [SLIDES, LEAVES]
    assert largest(run.switches.time, [first, first + (f - x1) / belt]) < 1e-11
    assert largest(run.switches.after, [[x1, belt], [f, belt]]) < 1e-11
    assert list(run.switches.direction) == [-1.0, -1.0]
    # then a turn about f with the belt's speed as its radius
    angle = 6.0 - float(run.switches.time[1])
    wanted = [f + belt * np.sin(angle), belt * np.cos(angle)]
    assert largest(run.final, wanted) < 1e-11


@pytest.mark.parametrize("static", [1.0, 1.5, 2.5])
def test_stick_slip_cycle_with_static_friction(static):
    """Stick from -x1 to static f, slip on an arc about f: the period is exact."""
    f, belt = 0.4, 0.3
    run = run_of(Rubbing(friction=f, belt=belt, static=static), [0.0, belt], 60.0)
    leave = static * f
    # an arc about f through (leave, belt), which returns to this speed at 2 f - leave
    slip = 2 * np.pi - 2 * np.arctan2(leave - f, belt)
    stick = (2 * leave - 2 * f) / belt
    leaves = np.asarray(run.switches.time[run.switches.kind == LEAVES])
    assert abs(leaves[0] - leave / belt) < 1e-11
    if static > 1:
        assert len(leaves) >= 5
        assert largest(np.diff(leaves), stick + slip) < 1e-10
        ends = np.asarray(run.switches.after[run.switches.kind == SLIDES])
        assert largest(ends, np.broadcast_to([2 * f - leave, belt], ends.shape)) < 1e-11


class Hitting(Rubbing):
    """The same block and a wall at x = wall + swing cos(omega t)."""

    wall: float = 0.5
    restitution: float = 0.5
    swing: float = 0.0

    def gap(self, t, state):
        return self.wall + self.swing * jnp.cos(self.omega * t) - state[0]

    def impact(self, t, state):
        speed = -self.swing * self.omega * jnp.sin(self.omega * t)
        rebound = speed - self.restitution * (state[1] - speed)
        return jnp.stack([state[0], rebound])


def falls(system, run):
    """The energy of a body without a drive never grows."""
    states = np.asarray(run.steps.state)
    energy = np.sum(states**2, axis=1) / 2
    assert np.all(np.diff(energy) <= 1e-11 * (1 + energy[0]))
    slides = np.asarray(run.steps.sides[:, 0]) == 0
    assert np.max(np.abs(states[slides, 1] - system.belt), initial=0.0) <= 1e-10


def test_block_that_hits_a_wall_and_rubs():
    """Arcs about -f and f between turning points and impacts; then it sticks."""
    f, wall, r = 0.1, 0.5, 0.5
    system = Hitting(friction=f, wall=wall, restitution=r)
    run = run_of(system, [-2.0, 0.0], 30.0)
    t, x, impacts, turns = 0.0, -2.0, [], []
    while abs(x) > f:
        radius = abs(x) - f
        if x < 0 and radius - f > wall:
            # rising about -f to the wall, then falling about f
            t += np.arccos(-(wall + f) / radius)
            impacts.append(t)
            v = r * np.sqrt(radius**2 - (wall + f) ** 2)
            t += np.pi - np.arctan2(v, wall - f)
            x = f - np.hypot(wall - f, v)
        else:
            t, x = t + np.pi, (radius - f) * -np.sign(x)
        turns.append((t, x))
    assert len(impacts) == 2 and len(turns) == 4
    assert largest(run.impacts.time, impacts) < 1e-11
    turning = np.abs(run.switches.after[:, 1]) < 1e-9
    assert largest(run.switches.time[turning], [t for t, _ in turns]) < 1e-11
    assert largest(run.switches.after[turning, 0], [x for _, x in turns]) < 1e-11
    assert run.switches.kind[-1] == SLIDES
    falls(system, run)


def test_block_that_a_spring_pushes_against_a_wall():
    """It comes to rest on the wall, or sticks in front of it after a rebound."""
    for friction, contacts in ((0.1, 1), (0.6, 0)):
        system = Hitting(friction=friction, wall=-0.5)
        run = run_of(system, [-2.0, 0.0], 30.0)
        falls(system, run)
        assert int(run.contacts.count) == contacts
        assert run.final[1] == 0 and (run.final[0] == -0.5) == (contacts == 1)


def test_a_wall_lets_go_before_friction_does():
    """The drive pulls the block off the wall; friction holds until its limit."""
    f, w = 0.1, 0.5
    system = Hitting(friction=f, wall=-0.5, drive=1.0, omega=w)
    run = run_of(system, [-2.0, 0.0], 60.0)
    assert int(run.contacts.count) >= 3
    slides, leaves = (
        np.asarray(run.switches.time[run.switches.kind == kind])
        for kind in (SLIDES, LEAVES)
    )
    assert len(slides) == len(leaves) >= 1
    assert np.all(np.isin(slides, np.asarray(run.contacts.end)))
    assert largest(np.cos(w * leaves) + 0.5, -f) < 1e-12


def test_a_moving_wall_pushes_a_block_that_then_sticks():
    """It leaves the block behind where it turns back."""
    system = Hitting(friction=0.6, wall=0.2, swing=0.3)
    run = run_of(system, [0.3, 0.0], 9.0)
    assert int(run.contacts.count) == 1
    assert largest(run.contacts.end, np.pi) < 1e-9
    assert largest(run.final, [-0.1, 0.0]) < 1e-9
    # an impact ends sliding, and another sliding follows
    hit = int(np.argmax(run.steps.time >= run.impacts.time[0]))
    assert run.steps.sides[0, 0] == 0 and run.steps.sides[hit, 0] != 0
    assert run.steps.sides[-1, 0] == 0


class Chain(SwitchedSystem):
    """Two masses with dry friction between springs; the first one is driven."""

    friction: jax.Array
    drive: float = 1.5
    omega: float = 0.7

    def switching(self, t, state):
        del t
        return state[2:]

    def branch(self, t, state, sides):
        x, y = state[0], state[1]
        push = jnp.stack([self.drive * jnp.sin(self.omega * t) - 2 * x + y, x - 2 * y])
        return jnp.concatenate([state[2:], push - self.friction * sides])


def test_two_masses_stick_and_let_go_one_after_the_other():
    f, g, a, w = 0.5, 0.3, 1.5, 0.7
    system = Chain(jnp.array([f, g]), drive=a, omega=w)
    run = run_of(system, np.zeros(4), 8.0)
    assert np.all(np.asarray(run.steps.sides[0]) == 0)
    first = np.arcsin(f / a) / w

    # x'' + 2 x = a sin(w t) - f from rest, until the spring pulls the other with g
    root, gain = np.sqrt(2.0), a / (2 - w**2)

    def x(t):
        lag = t - first
        c = f / 2 - gain * np.sin(w * first)
        d = -gain * w * np.cos(w * first) / root
        moved = c * np.cos(root * lag) + d * np.sin(root * lag)
        return gain * np.sin(w * t) - f / 2 + moved

    second = brentq(lambda t: x(t) - g, first, first + 2.0, xtol=1e-15)
    assert list(run.switches.kind[:2]) == [LEAVES, LEAVES]
    assert list(run.switches.surface[:2]) == [0, 1]
    assert largest(run.switches.time[:2], [first, second]) < 1e-11
    # what follows, by another integrator: smooth pieces between the events found
    times = np.append(np.asarray(run.switches.time), 8.0)
    t, y = times[1], np.asarray(run.switches.after[1])
    for k, end in enumerate(times[2:], start=1):
        row = int(np.flatnonzero(np.asarray(run.steps.time) == t)[-1])
        sides = np.asarray(run.steps.sides[row])

        def field(s, z, sides=sides):
            push = [a * np.sin(w * s) - 2 * z[0] + z[1], z[0] - 2 * z[1]]
            free = np.array(push) - np.array([f, g]) * sides
            return np.concatenate([z[2:], np.where(sides == 0, 0.0, free)])

        made = solve_ivp(field, (t, end), y, "DOP853", rtol=1e-13, atol=1e-14)
        t, y = end, made.y[:, -1]
        if k + 1 < len(run.switches.time):
            assert largest(run.switches.after[k + 1], y) < 1e-10
            push = [a * np.sin(w * t) - 2 * y[0] + y[1], y[0] - 2 * y[1]]
            which, kind = int(run.switches.surface[k + 1]), run.switches.kind[k + 1]
            limit = [f, g][which]
            if kind == LEAVES:
                assert abs(abs(push[which]) - limit) < 1e-10
            if kind == SLIDES:
                assert abs(push[which]) < limit
            if kind == CROSSES:
                assert abs(push[which]) > limit
    assert largest(run.final, y) < 1e-10
    assert set(np.asarray(run.switches.kind)) == {CROSSES, SLIDES, LEAVES}


@settings(max_examples=40)
@given(
    st.floats(-3.0, 3.0),
    st.floats(-3.0, 3.0),
    st.floats(0.01, 1.0),
    st.floats(1.0, 2.0),
    st.floats(-1.5, 1.5),
)
def test_energy_falls_and_a_stuck_body_rests(x, v, friction, static, wall):
    # no step is short enough for a velocity near the smallest number
    v = v if abs(v) > 1e-300 else 0.0
    system = Rubbing(friction=friction, static=static)
    run = jaxcam.simulate(system, [x, v], 0.0, 25.0)
    assert run.successful
    falls(system, run)
    system = Hitting(friction=friction, static=static, wall=wall)
    run = jaxcam.simulate(system, [min(x, wall - 0.01), v], 0.0, 25.0)
    assert run.successful, run.result
    falls(system, run)


def test_a_batch_is_what_its_members_are():
    forces = jnp.array([0.2, 0.5, 0.6, 1.2])
    states = jnp.array([[0.3, 0.5], [-1.0, 0.0], [2.0, 0.1], [0.0, 0.0]])

    def run(force, state):
        system = Rubbing(friction=force, drive=jnp.asarray(1.0), omega=jnp.asarray(0.5))
        found = jaxcam.simulate(system, state, 0.0, 30.0, max_steps=512)
        return found.switches, found.code

    switches, codes = jax.jit(jax.vmap(run))(forces, states)
    assert np.all(codes == 0)
    for k, (force, state) in enumerate(zip(forces, states, strict=True)):
        alone = jaxcam.simulate(
            Rubbing(friction=force, drive=1.0, omega=0.5), state, 0.0, 30.0
        )
        count = int(alone.switches.count)
        assert int(switches.count[k]) == count
        assert largest(switches.time[k, :count], alone.switches.time) < 1e-9
        assert np.array_equal(switches.kind[k, :count], alone.switches.kind)
    assert np.max(switches.count) > 5


_slopes = eqx.filter_jit(
    lambda system, state, t1: jax.jacfwd(
        lambda s, x: end_of(s, x, t1).state, argnums=(0, 1)
    )(system, state)
)


def arrays(system):
    return jax.tree.map(lambda a: jnp.asarray(a, dtype=jnp.float64), system)


def test_derivatives_through_stick_and_slip():
    """Entering, sliding and leaving, against closed forms and central differences."""
    # a block on a belt: the end forgets the start once it has stuck
    f, belt, x0, v0, t1 = 0.4, 0.3, -0.9, 0.5, 6.0
    system, state = arrays(Rubbing(friction=f, belt=belt)), jnp.array([x0, v0])
    by_system, by_state = _slopes(system, state, jnp.asarray(t1))

    def end(f, belt, x0, v0):
        radius, phase = jnp.hypot(x0 + f, v0), jnp.arctan2(v0, x0 + f)
        first = phase - jnp.arcsin(belt / radius)
        x1 = -f + radius * jnp.cos(first - phase)
        angle = t1 - first - (f - x1) / belt
        return jnp.stack([f + belt * jnp.sin(angle), belt * jnp.cos(angle)])

    exact = jax.jacfwd(end, argnums=(0, 1, 2, 3))(f, belt, x0, v0)
    found = by_system.friction, by_system.belt, by_state[:, 0], by_state[:, 1]
    assert largest(found, exact) < 1e-9
    # forced motions with several sticks
    for drive, omega, friction in ((1.0, 0.5, 0.6), (2.0, 1.7, 0.4), (1.0, 0.25, 0.5)):
        system = Rubbing(friction=friction, drive=drive, omega=omega, static=1.1)
        system, state, t1 = arrays(system), jnp.array([0.3, 0.5]), jnp.asarray(13.0)
        by_system, by_state = _slopes(system, state, t1)
        for name in ("friction", "drive", "omega", "static", "belt"):
            step = 1e-5
            ends = [
                end_of(
                    eqx.tree_at(lambda s: getattr(s, name), system, replace_fn=up),
                    state,
                    t1,
                ).state
                for up in (lambda a: a + step, lambda a: a - step)
            ]
            wanted = (ends[0] - ends[1]) / (2 * step)
            size = 1 + np.max(np.abs(wanted))
            assert largest(getattr(by_system, name), wanted) < 1e-6 * size
        for i, unit in enumerate(np.eye(2)):
            ends = [end_of(system, state + s * 1e-5 * unit, t1).state for s in (1, -1)]
            assert largest(by_state[:, i], (ends[0] - ends[1]) / 2e-5) < 1e-6


def test_the_model_is_this_system(tmp_path):
    model = DryFrictionOscillator(omega=0.5, friction=0.6, static=1.1)
    other = Rubbing(friction=0.6, drive=1.0, omega=0.5, static=1.1)
    runs = [run_of(system, [0.3, 0.5], 20.0) for system in (model, other)]
    assert largest(runs[0].switches.time, runs[1].switches.time) < 1e-13
    assert np.array_equal(runs[0].switches.kind, runs[1].switches.kind)
    save_system(model, tmp_path / "system.json")
    assert eqx.tree_equal(load_system(tmp_path / "system.json"), model)
    with pytest.raises(ValueError, match="holding"):
        jaxcam.simulate(DryFrictionOscillator(static=0.9), [0.0, 0.0], 0.0, 1.0)


def test_a_start_where_both_branches_leave_takes_the_given_side():
    class Escaping(Rubbing):
        def branch(self, t, state, sides):
            return jnp.stack([state[1], self.friction * sides[0]])

    run = run_of(Escaping(), [0.0, 0.0], 2.0)
    assert int(run.switches.count) == 0
    assert largest(run.final, [0.6, 0.6]) < 1e-12


class Stack(SwitchedSystem):
    """A light block on another on the ground, with more friction below than between."""

    pull: float = 0.1

    def switching(self, t, state):
        del t
        return jnp.stack([state[2], state[3] - state[2]])

    def branch(self, t, state, sides):
        below, between = 1.0 * sides[0], 0.2 * sides[1]
        pull = self.pull * t - between
        return jnp.stack([state[2], state[3], between - below, pull])


def test_a_stack_at_rest_stays_at_rest():
    """The upper block would slip if the lower one did; it slips at 0.1 t = 0.2."""
    run = run_of(Stack(), np.zeros(4), 3.0)
    assert run.switches.kind.tolist() == [LEAVES]
    assert abs(run.switches.time[0] - 2.0) < 1e-12
    # between - below = 0.2 - 0.2: the lower block does not move
    np.testing.assert_allclose(run.final, [0.0, 0.05 / 3, 0.0, 0.05], atol=1e-12)


@pytest.mark.parametrize("load", [1.0, -1.0, 1.05, -1.05])
def test_static_friction_holds_two_blocks_from_the_start(load):
    """Loads of one, the kinetic friction, and more; static friction is 1.5."""

    class Blocks(SwitchedSystem):
        @property
        def holding(self) -> Any:
            return 1.5

        def switching(self, t, state):
            return state[2:]

        def branch(self, t, state, sides):
            forces = jnp.stack([load + 0 * t, load + 0 * t]) - sides
            return jnp.concatenate([state[2:], forces])

    run = run_of(Blocks(), np.zeros(4), 3.0)
    assert not run.switches.kind.size and not np.any(run.final)
