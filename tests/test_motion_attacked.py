"""Defects that random systems (`benchmarks/attack.py`) have shown, by closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem, simulate


def turned(angle):
    """A rotation by `angle` (rad)."""
    c, s = jnp.cos(angle), jnp.sin(angle)
    return jnp.array([[c, -s], [s, c]])


class Corner(HybridSystem):
    """A body in the plane between a floor and a wall, in coordinates turned by `angle`.

    In its own coordinates (x, y) the wall is at x = `reach` and the floor at y = 0. The
    force along y is -1 + `lift` t.
    """

    lift: float = 0.0
    reach: jax.Array | float = 10.0
    angle: float = 0.0
    restitution: float = 0.5

    def _own(self, state):
        back = turned(self.angle).T
        return back @ state[:2], back @ state[2:]

    def vector_field(self, t, state):
        force = jnp.stack([jnp.zeros_like(t), self.lift * t - 1.0])
        return jnp.concatenate([state[2:], turned(self.angle) @ force])

    def gap(self, t, state):
        (x, y), _ = self._own(state)
        return jnp.stack([y, self.reach - x])

    def impact(self, t, state):
        _, (u, v) = self._own(state)
        turn, zero = turned(self.angle), jnp.zeros_like(u)
        down = turn @ jnp.stack([zero, -(1 + self.restitution) * v])
        back = turn @ jnp.stack([-(1 + self.restitution) * u, zero])
        place = state[:2]
        return jnp.stack(
            [jnp.concatenate([place, state[2:] + jump]) for jump in (down, back)]
        )


def on_the_floor(angle, speed):
    """A start at x = 0 on the floor, sliding."""
    return np.concatenate([np.zeros(2), turned(angle) @ np.array([speed, 0.0])])


@pytest.mark.parametrize("angle", np.linspace(0.1, 6.1, 13))
def test_restitution_of_a_body_that_slides(angle):
    """Its normal velocity is rounding alone, which says nothing of the impact law.

    At t = 2 it has slid 2 * 3 along the floor, to 1e-12.
    """
    made = simulate(Corner(angle=angle), on_the_floor(angle, 3.0), 0.0, 2.0)
    assert made.successful
    there = turned(angle) @ np.array([6.0, 0.0])
    np.testing.assert_allclose(made.final[:2], there, rtol=0, atol=1e-12)


@pytest.mark.parametrize("late", [1e-3, 1e-5, 1e-7])
def test_a_release_shortly_before_an_impact_on_another_wall(late):
    """The floor is left at t = 1, where the force on it vanishes, to 1e-10.

    The wall is hit `late` seconds behind it, which is far less than a step.
    """
    speed = 3.0
    system = Corner(lift=1.0, reach=jnp.asarray(speed * (1.0 + late)))
    made = simulate(system, on_the_floor(0.0, speed), 0.0, 1.5)
    assert made.successful
    (end,), (hit,) = made.contacts.end, made.impacts.time
    assert end == pytest.approx(1.0, abs=1e-10)
    assert hit == pytest.approx(1.0 + late, abs=1e-10)
    # y'' = t - 1 from there on
    assert made.final[1] == pytest.approx(0.5**3 / 6, abs=1e-10)


class Shaken(HybridSystem):
    """A ball above a table a cos(t + phase) that falls; with a breakpoint elsewhere."""

    phase: float
    size: float = 0.3
    declared: bool = True

    def table(self, t):
        angle = t + self.phase
        return self.size * jnp.cos(angle), -self.size * jnp.sin(angle)

    def vector_field(self, t, state):
        return jnp.stack([state[1], -jnp.ones_like(t)])

    def gap(self, t, state):
        return state[0] - self.table(t)[0]

    def impact(self, t, state):
        speed = self.table(t)[1]
        return state.at[1].set(speed - 0.5 * (state[1] - speed))

    @property
    def breakpoints(self):
        return jnp.array([30.0]) if self.declared else None


@pytest.mark.parametrize("phase", np.linspace(0.2, 6.0, 15))
def test_a_start_on_a_moving_table_moving_in(phase):
    """An impact at t = 0 and then the flight y0 + u t - t^2 / 2, to 1e-12.

    Times elsewhere than at the breakpoint are not moved: a table seen later by the
    rounding of the end of the run (300 s) would be through the ball.
    """
    system = Shaken(phase=phase)
    place, speed = map(float, system.table(jnp.asarray(0.0)))
    approach, late = -2.0, 0.3
    made = simulate(system, np.array([place, speed + approach]), 0.0, 300.0)
    assert made.impacts.time[0] == pytest.approx(0.0, abs=1e-16)
    assert made.impacts.speed_after[0] == pytest.approx(1.0, abs=1e-12)
    u = speed + 1.0
    np.testing.assert_allclose(
        made.at(np.array([late]))[0],
        [place + u * late - late**2 / 2, u - late],
        rtol=0,
        atol=1e-12,
    )


@pytest.mark.parametrize("speed", [-1e-16, 1e-16])
def test_a_start_at_rest_whose_velocity_is_rounding(speed):
    """Contact from the start, without an impact of 1e-16 m/s before it.

    Both coordinates of the place are of order one, so the gap is known to 1e-16.
    """
    turn = turned(0.5)
    start = np.concatenate([turn @ np.array([1.0, 0.0]), turn @ np.array([0.0, speed])])
    made = simulate(Corner(angle=0.5), start, 0.0, 1.0)
    assert made.successful and not len(made.impacts.time)
    assert list(made.contacts.start) == [0.0]


LATE, NEAR, APPROACH, R = 1e4, 1.0, 0.3, 0.6


class Wedge(HybridSystem):
    """A body that slides on a floor into a moving oblique wall, which presses it down.

    The wall moves with `APPROACH` towards the body, normal to itself. The coordinates
    are turned by `turn` and start at (1, 1), so that the floor's gap is rounded, too.
    """

    tilt: jax.Array
    turn: jax.Array

    def vector_field(self, t, state):
        down = turned(self.turn) @ jnp.stack([jnp.zeros_like(t), -1.0])
        return jnp.concatenate([state[2:], down])

    def normals(self):
        """Of the floor and of the wall."""
        wall = jnp.stack([-jnp.cos(self.tilt), -jnp.sin(self.tilt)])
        return jnp.stack([jnp.array([0.0, 1.0]), wall]) @ turned(self.turn).T

    def gap(self, t, state):
        moved = NEAR - APPROACH * (t - LATE)
        return self.normals() @ (state[:2] - 1) + jnp.stack([jnp.zeros_like(t), moved])

    def impact(self, t, state):
        del t
        rows = []
        for normal, speed in zip(self.normals(), (0.0, -APPROACH), strict=True):
            jump = -(1 + R) * (normal @ state[2:] + speed) * normal
            rows.append(jnp.concatenate([state[:2], state[2:] + jump]))
        return jnp.stack(rows)


@pytest.mark.parametrize("tilt", np.linspace(0.78, 1.2, 20))
def test_impacts_in_no_time_on_a_wall_that_moves_late(tilt):
    """Wall and floor in turn, in no time, as a loop over two numbers says: to 1e-9.

    A late time is rounded to 2e-12 s, and with it the place of the wall and of a body
    that is put on it: by far more than the rounding of the height above the floor.
    """
    speed, system = 2.0, Wedge(jnp.asarray(tilt), jnp.asarray(0.7))
    normals = np.array([[0.0, 1.0], [-np.cos(tilt), -np.sin(tilt)]])
    at = NEAR / (speed * np.cos(tilt) + APPROACH)
    velocity, closing = np.array([speed, 0.0]), np.array([0.0, APPROACH])
    hits = 0
    while np.min(rates := normals @ velocity - closing) < 0:
        k = 1 - hits % 2
        velocity = velocity - (1 + R) * rates[k] * normals[k]
        hits += 1
    assert hits >= 4
    late, turn = 0.1 * velocity[1], np.asarray(turned(0.7))
    start = np.concatenate([np.ones(2), turn @ [speed, 0.0]])
    made = simulate(system, start, LATE, LATE + at + late)
    assert made.successful and len(made.impacts.time) == hits
    np.testing.assert_allclose(made.impacts.time, LATE + at, rtol=0, atol=1e-10)
    there = [speed * at + velocity[0] * late, velocity[1] * late - late**2 / 2]
    np.testing.assert_allclose(made.final[:2], 1 + turn @ there, rtol=0, atol=1e-9)
