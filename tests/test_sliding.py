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
    # an arc about f through (leave, belt): it returns to the belt's speed at 2 f - leave
    slip = 2 * np.pi - 2 * np.arctan2(leave - f, belt)
    stick = (2 * leave - 2 * f) / belt
    leaves = np.asarray(run.switches.time[run.switches.kind == LEAVES])
    assert abs(leaves[0] - leave / belt) < 1e-11
    if static > 1:
        assert len(leaves) >= 5
        assert largest(np.diff(leaves), stick + slip) < 1e-10
        ends = np.asarray(run.switches.after[run.switches.kind == SLIDES])
        assert largest(ends, np.broadcast_to([2 * f - leave, belt], ends.shape)) < 1e-11


def energy(system: Rubbing, states):
    return (states[:, 0] ** 2 + states[:, 1] ** 2) / 2


class Hitting(Rubbing):
    """The same block with a wall at x = wall, restitution 0.5."""

    wall: float = 0.8
    restitution: float = 0.5

    def gap(self, t, state):
        return self.wall - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


def test_block_that_hits_a_wall_and_rubs():
    """Arcs between impacts and turning points; it sticks in its dead zone."""
    f, wall, r = 0.1, 0.5, 0.5
    run = run_of(Hitting(friction=f, wall=wall), [-2.0, 0.0], 30.0)
    # the wall, by energy: (x + f)^2 + v^2 is constant while v > 0
    t, x, impacts, turns = 0.0, -2.0, [], []
    while True:
        # rising from (x, 0): an arc about -f
        if abs(x) <= f:
            break
        radius = -(x + f)
        if radius - f > wall:
            t += np.arccos(-(wall + f) / radius)
            v = r * np.sqrt(radius**2 - (wall + f) ** 2)
            impacts.append(t)
            # falling: an arc about +f
            radius = np.hypot(wall - f, v)
            t += np.pi - np.arctan2(v, wall - f) + 0.0
            x = f - radius
            turns.append((t, x))
        else:
            x = radius - f
            t += np.pi
            turns.append((t, x))
            if abs(x) <= f:
                break
            x = f - (x - f)
            t += np.pi
            turns.append((t, x))
    print(impacts, turns, run.impacts, run.switches)
