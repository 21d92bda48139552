"""Motion against closed forms: every number compared with is computed from a formula.

Times in s; "to 1e-10" is absolute unless it says relative.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem, Settings, simulate
from jaxcam.hybrid.surface import normal_velocity
from jaxcam.models import BouncingBall, ImpactOscillator


GRAVITY, LAUNCH, HEIGHT = 9.81, 3.0, 2.0
RESTITUTIONS = (0.3, 0.5, 0.7, 0.8, 0.9, 0.97, 0.99)
# omega, restitution, n of exact orbits with one impact per n forcing periods
ORBITS = (
    (2.8, 0.8, 1),
    (2.6, 0.8, 1),
    (2.5, 0.6, 1),
    (2.2, 0.5, 1),
    (4.3, 0.6, 2),
    (3.7, 0.8, 2),
    (1.8, 0.7, 1),
)


def run(system, state, t0, t1, **options):
    trajectory = simulate(system, jnp.asarray(state, dtype=float), t0, t1, **options)
    assert trajectory.result == ""
    assert float(trajectory.steps.time[-1]) == pytest.approx(t1, abs=1e-14)
    return trajectory


def ball(r, **options):
    return BouncingBall(gravity=GRAVITY, restitution=r, **options)


# --- ball on a fixed floor


@pytest.mark.parametrize("r", RESTITUTIONS)
def test_launched_ball_bounces_and_rests(r):
    rest = 2 * LAUNCH / GRAVITY / (1 - r)
    trajectory = run(ball(r), [0.0, LAUNCH], 0.0, 1.2 * rest)
    impacts, contacts = trajectory.impacts, trajectory.contacts
    k = np.arange(1, int(impacts.count) + 1)
    times = 2 * LAUNCH / GRAVITY * (1 - r**k) / (1 - r)
    assert np.max(np.abs(impacts.time - times)) < 1e-10  # s
    assert np.max(np.abs(impacts.speed_after / (LAUNCH * r**k) - 1)) < 1e-7
    assert np.max(np.abs(impacts.speed_after - LAUNCH * r**k)) < 1e-12  # m/s
    assert int(contacts.count) == 1
    assert abs(float(contacts.start[0]) - rest) < 1e-10  # s
    assert not bool(contacts.released[0])
    assert float(contacts.end[0]) == float(trajectory.t1)
    assert np.all(np.asarray(trajectory.final) == 0.0)


@pytest.mark.parametrize("r", RESTITUTIONS)
def test_dropped_ball_rests_in_time_after_its_path(r):
    first = np.sqrt(2 * HEIGHT / GRAVITY)
    rest = first * (1 + r) / (1 - r)
    trajectory = run(ball(r), [HEIGHT, 0.0], 0.0, 1.1 * rest)
    assert abs(float(trajectory.impacts.time[0]) - first) < 1e-10
    assert abs(float(trajectory.contacts.start[0]) - rest) < 1e-10
    # twice every apex after the first fall; an apex is v^2 / 2g
    apexes = np.asarray(trajectory.impacts.speed_after) ** 2 / (2 * GRAVITY)
    path = HEIGHT * (1 + r**2) / (1 - r**2)
    assert abs(HEIGHT + 2 * np.sum(apexes) - path) < 1e-10 * path


def test_sixty_impacts_before_completion():
    r = 0.8
    trajectory = run(ball(r), [0.0, LAUNCH], 0.0, 5.0)
    assert int(trajectory.impacts.count) >= 60


def test_depth_of_chatter_lists_more_impacts_and_moves_nothing():
    r, counts = 0.8, []
    rest = 2 * LAUNCH / GRAVITY / (1 - r)
    # the last one is deeper than rounding lets a hop be seen
    for depth in (1e-2, 1e-4, 1e-6, 1e-9):
        settings = Settings(chatter_depth=depth)
        trajectory = run(ball(r), [0.0, LAUNCH], 0.0, 5.0, settings=settings)
        counts.append(int(trajectory.impacts.count))
        assert abs(float(trajectory.contacts.start[0]) - rest) < 1e-10
    wanted = [int(np.ceil(np.log(d) / np.log(r))) for d in (1e-2, 1e-4, 1e-6)]
    # depth is relative to the fastest rebound, which is the first: r v0
    assert counts[:3] == [n + 1 for n in wanted]
    assert counts[3] >= counts[2]


def test_energy_over_a_thousand_elastic_impacts():
    first = np.sqrt(2 * HEIGHT / GRAVITY)
    trajectory = run(ball(1.0), [HEIGHT, 0.0], 0.0, 2000 * first)
    impacts = trajectory.impacts
    assert int(impacts.count) == 1000
    energy = np.asarray(impacts.after) @ [GRAVITY, 0.0]
    energy = energy + np.asarray(impacts.after)[:, 1] ** 2 / 2
    assert np.max(np.abs(energy / (GRAVITY * HEIGHT) - 1)) < 1e-9
    times = first * (2 * np.arange(1000) + 1)
    assert np.max(np.abs(impacts.time - times)) < 1e-10


def test_perfectly_plastic_ball_stops_at_its_first_impact():
    first = np.sqrt(2 * HEIGHT / GRAVITY)
    trajectory = run(ball(0.0), [HEIGHT, 0.0], 0.0, 3 * first)
    assert int(trajectory.impacts.count) == 1
    assert abs(float(trajectory.impacts.time[0]) - first) < 1e-10
    assert abs(float(trajectory.contacts.start[0]) - first) < 1e-10
    assert np.all(np.asarray(trajectory.final) == 0.0)


def test_samples_are_the_closed_form():
    r, rest = 0.5, 2 * LAUNCH / GRAVITY / 0.5
    trajectory = run(ball(r), [0.0, LAUNCH], 0.0, 1.2 * rest)
    times = np.linspace(0.0, 1.2 * rest, 1000)
    k = np.floor(np.log1p(-np.minimum(times / rest, 1 - 1e-9)) / np.log(r))
    since, speed = times - rest * (1 - r**k), LAUNCH * r**k
    height = since * (speed - GRAVITY * since / 2)
    height = np.where(times < rest, height, 0.0)
    assert np.max(np.abs(trajectory.at(times)[:, 0] - height)) < 1e-10  # m
    assert np.max(np.abs(trajectory.gap(times) - height)) < 1e-10  # m
    assert float(jnp.min(trajectory.gap(times))) >= -1e-12


def test_traced_samples_outside_the_run_are_nan():
    """Where times are known they are refused; nothing is made up where they are not."""

    @jax.jit
    def height(times):
        start = jnp.array([0.0, LAUNCH])
        trajectory = simulate(ball(0.5), start, 0.0, 0.1, max_steps=64)
        return trajectory.at(times)[:, 0]

    found = height(jnp.array([-0.01, 0.05, 0.11, 10.0]))
    assert np.isnan(found).tolist() == [True, False, True, True]
    assert abs(found[1] - 0.05 * (LAUNCH - GRAVITY * 0.05 / 2)) < 1e-12


# --- starting on the surface


def test_start_at_rest_on_the_floor_is_contact():
    trajectory = run(ball(0.5), [0.0, 0.0], 1.0, 2.0)
    assert int(trajectory.impacts.count) == 0
    assert int(trajectory.contacts.count) == 1
    assert float(trajectory.contacts.start[0]) == 1.0
    assert float(trajectory.contacts.end[0]) == 2.0
    assert np.all(np.asarray(trajectory.at([1.0, 1.5, 2.0])) == 0.0)


def test_start_on_the_floor_moving_in_is_an_impact_at_once():
    r = 0.5
    trajectory = run(ball(r), [0.0, -LAUNCH], 1.0, 1.2)
    assert float(trajectory.impacts.time[0]) == 1.0
    assert float(trajectory.impacts.speed_before[0]) == -LAUNCH
    assert np.asarray(trajectory.impacts.after[0]).tolist() == [0.0, r * LAUNCH]
    # an impact at a sampled time has happened
    assert np.asarray(trajectory.at([1.0])[0]).tolist() == [0.0, r * LAUNCH]


def test_start_on_a_floor_that_falls_away_is_flight():
    amplitude, frequency = 0.05, 30.0  # 4.6 g
    table = ball(0.5, amplitude=amplitude, frequency=frequency)
    t0 = np.pi / 2 / frequency  # top of the table's motion
    trajectory = run(table, [amplitude, 0.0], t0, t0 + 0.05)
    assert int(trajectory.contacts.count) == 0
    times = t0 + np.linspace(0.0, 0.05, 9)
    height = amplitude - GRAVITY * (times - t0) ** 2 / 2
    assert np.max(np.abs(trajectory.at(times)[:, 0] - height)) < 1e-12


def test_no_time_at_all():
    for state in ([HEIGHT, 0.0], [0.0, LAUNCH], [0.0, 0.0]):
        trajectory = run(ball(0.5), state, 1.0, 1.0)
        assert int(trajectory.impacts.count) == 0
        assert np.asarray(trajectory.final).tolist() == state
        assert np.asarray(trajectory.at([1.0])[0]).tolist() == state


@pytest.mark.parametrize("late", [0.0, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15])
@pytest.mark.parametrize("side", [-1, 1])
def test_end_close_to_an_impact(late, side):
    # third impact of the orbit that repeats with every second period of the forcing
    omega, r, n, wall = 3.7, 0.8, 2, 0.1
    speed, phase, period = max(orbits(omega, r, n, wall))
    t0 = phase / omega
    t1 = t0 + 3 * period + side * late
    system = ImpactOscillator(omega=omega, restitution=r, wall=wall)
    trajectory = run(system, [wall, -r * speed], t0, t1)
    assert np.all(np.asarray(trajectory.impacts.time) <= t1)
    if late > 1e-10:
        assert int(trajectory.impacts.count) == (2 if side < 0 else 3)


# --- forced oscillator


def orbits(omega, r, n, wall):
    """Speed at the wall, phase of the forcing there, and period of exact orbits."""
    gamma, period = 1 / (1 - omega**2), 2 * np.pi * n / omega
    k = (1 + r) / np.tan(period / 2) / 2
    m = (1 - r) / (2 * omega)
    square, half, rest = k**2 + m**2, k * wall, wall**2 - gamma**2
    root = half**2 - square * rest
    if root < 0:
        return
    for sign in (1, -1):
        speed = (-half + sign * np.sqrt(root)) / square
        if speed > 0:
            phase = np.arctan2(-m * speed / gamma, (wall + k * speed) / gamma)
            yield speed, phase, period


@pytest.mark.parametrize("omega, r, n", ORBITS)
@pytest.mark.parametrize("wall", [0.0, 0.1])
def test_exact_orbits_return_to_themselves(omega, r, n, wall):
    for speed, phase, period in orbits(omega, r, n, wall):
        if speed < 0.1:
            continue
        t0 = phase / omega
        system = ImpactOscillator(omega=omega, restitution=r, wall=wall)
        trajectory = run(
            system, [wall, -r * speed], t0, t0 + 1.25 * period, tolerance=1e-12
        )
        impacts = trajectory.impacts
        assert abs(float(impacts.time[0]) - t0 - period) < 1e-10
        assert abs(float(impacts.speed_before[0]) + speed) < 1e-9
        assert np.max(np.abs(impacts.after[0] - np.array([wall, -r * speed]))) < 1e-9


@pytest.mark.parametrize("closer", [1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10])
def test_first_impact_speed_after_grazing(closer):
    omega, damping = 0.9, 0.05
    stiff, viscous = 1 - omega**2, 2 * damping * omega
    amplitude = 1 / np.hypot(stiff, viscous)
    lag = np.arctan2(viscous, stiff)
    t0 = (lag - 2.0) / omega
    state = amplitude * np.array([np.cos(-2.0), -omega * np.sin(-2.0)])
    wall = amplitude - closer
    system = ImpactOscillator(omega=omega, wall=wall, damping=damping)
    trajectory = run(system, state, t0, t0 + 2 * np.pi / omega, tolerance=1e-13)
    speed = omega * np.sqrt((amplitude - wall) * (amplitude + wall))
    found = -float(trajectory.impacts.speed_before[0])
    # where the wall is cut to 1e-12 the speed is uncertain by a dx / v
    assert abs(found**2 - speed**2) < 1e-10
    if closer >= 1e-2:
        assert abs(found / speed - 1) < 1e-9


def test_steady_orbit_just_short_of_the_wall_never_hits():
    omega, damping = 0.9, 0.05
    stiff, viscous = 1 - omega**2, 2 * damping * omega
    amplitude, lag = 1 / np.hypot(stiff, viscous), np.arctan2(viscous, stiff)
    t0, span = lag / omega, 20 * np.pi / omega
    for gap in (1e-2, 1e-5, 1e-9):
        system = ImpactOscillator(omega=omega, wall=amplitude + gap, damping=damping)
        half = t0 + np.pi / omega
        trajectory = run(system, [-amplitude, 0.0], half, half + span, tolerance=1e-12)
        assert int(trajectory.impacts.count) == 0
        states = np.asarray(trajectory.stroboscopic())
        assert states.shape == (11, 2)
        assert np.max(np.abs(np.asarray(states) - [-amplitude, 0.0])) < 1e-9
        times, crossed = map(
            np.asarray, trajectory.section(lambda t, x: x[0], direction=1)
        )
        exact = t0 + (2 * np.arange(1, 11) - 0.5) * np.pi / omega
        assert np.max(np.abs(times - exact)) < 1e-9
        assert np.max(np.abs(crossed - np.array([0.0, omega * amplitude]))) < 1e-9


# --- moving table


@pytest.mark.parametrize("r, k", [(0.5, 1), (0.8, 1), (0.3, 2), (0.7, 3)])
@pytest.mark.parametrize("side", [-1, 1])
def test_ball_on_table_once_every_k_periods(r, k, side):
    frequency, period = 31.0, 2 * np.pi * k / 31.0
    fold = k * np.pi * (1 - r) / (1 + r)
    gamma = 1.1 * fold
    phase = side * np.arccos(fold / gamma)
    amplitude = gamma * GRAVITY / frequency**2
    table = ball(r, amplitude=amplitude, frequency=frequency)
    t0 = phase / frequency
    # thrown up so as to come back after k periods at the same height
    start = np.array([amplitude * np.sin(phase), GRAVITY * period / 2])
    trajectory = run(table, start, t0, t0 + 1.5 * period)
    assert abs(float(trajectory.impacts.time[0]) - t0 - period) < 1e-10
    assert np.max(np.abs(trajectory.impacts.after[0] - start)) < 1e-9


def test_ball_leaves_the_table_where_it_falls_faster_than_free():
    gamma, frequency = 1.5, 31.0
    amplitude = gamma * GRAVITY / frequency**2
    table = ball(0.2, amplitude=amplitude, frequency=frequency)
    trajectory = run(table, [2 * amplitude, 0.0], 0.0, 2.0)
    ends = np.asarray(trajectory.contacts.end[trajectory.contacts.released])
    assert len(ends) >= 9
    assert np.max(np.abs(ends - nearest_release(ends, gamma, frequency))) < 1e-10
    # once it sticks every turn is the same
    assert np.max(np.abs(np.diff(ends) - 2 * np.pi / frequency)) < 1e-10
    released = simulate(table, None, 0.0, 2.0)
    assert released.result == ""
    ends = np.asarray(released.contacts.end[released.contacts.released])
    assert len(ends) >= 9
    assert np.max(np.abs(ends - nearest_release(ends, gamma, frequency))) < 1e-10


def nearest_release(times, gamma, frequency):
    """Where sin(frequency t) = 1 / gamma and rises."""
    phase = np.arcsin(1 / gamma)
    turns = np.round((frequency * times - phase) / (2 * np.pi))
    return (phase + 2 * np.pi * turns) / frequency


# --- events that are easily missed


class Level(HybridSystem):
    """A clock that counts when sin(time) passes a level: `side` tells where it is."""

    level: jax.Array

    def vector_field(self, t, state):
        return jnp.stack([jnp.ones_like(t), jnp.zeros_like(t)])

    def gap(self, t, state):
        clock, side = state
        return side * (self.level - jnp.sin(clock))

    def impact(self, t, state):
        clock, side = state
        return jnp.stack([clock, -side])


class LevelInTime(HybridSystem):
    """The same with the time itself in the gap."""

    level: jax.Array

    def vector_field(self, t, state):
        return jnp.zeros_like(state)

    def gap(self, t, state):
        return state[0] * (self.level - jnp.sin(t))

    def impact(self, t, state):
        return -state


@pytest.mark.parametrize("eps", [10.0**-k for k in range(1, 7)])
@pytest.mark.parametrize("kind", [Level, LevelInTime])
def test_fourteen_crossings_of_a_level_close_to_the_top(kind, eps):
    state = [0.0, 1.0] if kind is Level else [1.0]
    trajectory = run(kind(jnp.asarray(1 - eps)), state, 0.0, 40.0)
    up = np.arcsin(1 - eps)
    tops = 2 * np.pi * np.arange(7)
    exact = np.sort(np.concatenate([tops + up, tops + np.pi - up]))
    assert int(trajectory.impacts.count) == 14
    assert np.max(np.abs(trajectory.impacts.time - exact)) < 1e-10


@pytest.mark.parametrize("eps", [10.0**-k for k in range(1, 7)])
def test_elastic_wall_close_to_the_top(eps):
    class Spring(HybridSystem):
        wall: jax.Array

        def vector_field(self, t, state):
            return jnp.stack([state[1], -state[0]])

        def gap(self, t, state):
            return self.wall - state[0]

        def impact(self, t, state):
            return jnp.stack([state[0], -state[1]])

    trajectory = run(
        Spring(jnp.asarray(1 - eps)), [0.0, 1.0], 0.0, 40.0, tolerance=1e-13
    )
    up = np.arcsin(1 - eps)
    exact = up + np.arange(9) * (2 * up + np.pi)
    exact = exact[exact < 40]
    assert int(trajectory.impacts.count) == len(exact)
    energy = np.sum(np.asarray(trajectory.impacts.after) ** 2, axis=1)
    assert np.max(np.abs(energy - 1)) < 1e-10
    # an error in position moves the time by itself over the speed at the wall
    speed = np.sqrt(eps * (2 - eps))
    assert np.max(np.abs(trajectory.impacts.time - exact)) < 1e-11 / speed


class Passer(HybridSystem):
    """A body pushed away from the surface: y'' = 2 leaves room for a parabola."""

    def vector_field(self, t, state):
        return jnp.stack([state[1], 2 * jnp.ones_like(t)])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -0.5 * state[1]])


@pytest.mark.parametrize("clearance", [0.0, 1e-15, 1e-9, 1e-4])
def test_tangency_from_outside_is_no_impact(clearance):
    trajectory = run(Passer(), [1.0 + clearance, -2.0], 0.0, 3.0)
    assert int(trajectory.impacts.count) == 0
    assert int(trajectory.contacts.count) == 0
    assert np.max(np.abs(trajectory.final - np.array([4 + clearance, 4.0]))) < 1e-12


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-8])
def test_tangency_from_inside_is_one_slow_impact(depth):
    trajectory = run(Passer(), [1.0 - depth, -2.0], 0.0, 3.0)
    assert int(trajectory.impacts.count) == 1
    speed = 2 * np.sqrt(depth)
    assert abs(float(trajectory.impacts.speed_before[0]) ** 2 - speed**2) < 1e-13
    assert abs(float(trajectory.impacts.time[0]) - (1 - speed / 2)) < 1e-13 / speed


def test_start_that_grazes_leaves():
    trajectory = run(Passer(), [0.0, 0.0], 0.0, 2.0)
    assert int(trajectory.impacts.count) == int(trajectory.contacts.count) == 0
    assert np.max(np.abs(trajectory.final - np.array([4.0, 4.0]))) < 1e-12


# --- several constraints


class Box(HybridSystem):
    """A point between walls in each of its coordinates, without forces."""

    width: jax.Array
    restitution: jax.Array

    def vector_field(self, t, state):
        half = state.shape[0] // 2
        return jnp.concatenate([state[half:], jnp.zeros_like(state[half:])])

    def gap(self, t, state):
        place = state[: state.shape[0] // 2]
        return jnp.concatenate([place, self.width - place])

    def impact(self, t, state):
        half = state.shape[0] // 2
        rows = [
            state.at[half + k].multiply(-self.restitution)
            for _ in range(2)
            for k in range(half)
        ]
        return jnp.stack(rows)


def wall_times(place, speed, width, r, until):
    """Impact times of one coordinate between two walls, and the walls hit."""
    times, walls, t = [], [], 0.0
    while True:
        wall = int(speed > 0)
        t += (width - place if wall else place) / abs(speed)
        if t > until:
            return np.array(times), np.array(walls)
        times.append(t)
        walls.append(wall)
        place, speed = (width if wall else 0.0), -r * speed


def test_point_between_two_walls():
    width, r = 0.5, 0.9
    system = Box(jnp.asarray(width), jnp.asarray(r))
    trajectory = run(system, [0.2, 3.0], 0.0, 10.0)
    times, walls = wall_times(0.2, 3.0, width, r, 10.0)
    assert int(trajectory.impacts.count) == len(times)
    assert np.max(np.abs(trajectory.impacts.time - times)) < 1e-10
    assert np.array_equal(trajectory.impacts.constraint, walls)


def test_point_in_a_square_hits_the_nearer_wall_first():
    width, r = 1.0, 0.95
    system = Box(jnp.asarray(width), jnp.asarray(r))
    trajectory = run(system, [0.2, 0.7, 1.0, -np.sqrt(2)], 0.0, 8.0)
    across, sides = wall_times(0.2, 1.0, width, r, 8.0)
    along, ends = wall_times(0.7, -np.sqrt(2), width, r, 8.0)
    order = np.argsort(np.concatenate([across, along]))
    times = np.concatenate([across, along])[order]
    walls = np.concatenate([2 * sides, 2 * ends + 1])[order]
    assert np.max(np.abs(trajectory.impacts.time - times)) < 1e-10
    assert np.array_equal(trajectory.impacts.constraint, walls)


def test_corner_is_one_impact_on_both_walls():
    system = Box(jnp.asarray(1.0), jnp.asarray(0.5))
    trajectory = run(system, [0.5, 0.5, 1.0, 1.0], 0.0, 1.0)
    (wall,) = np.asarray(trajectory.impacts.constraint).tolist()
    assert wall in (2, 3)
    assert np.max(np.abs(trajectory.impacts.time - 0.5)) < 1e-12
    assert np.max(np.abs(trajectory.final - np.array([0.75, 0.75, -0.5, -0.5]))) < 1e-12


def test_impacts_are_sampled_after():
    system = ImpactOscillator(omega=2.0, restitution=0.8, wall=0.1)
    trajectory = run(system, [0.0, 1.0], 0.0, 30.0)
    impacts = trajectory.impacts
    assert int(impacts.count) > 8
    sampled = trajectory.at(impacts.time)
    assert np.max(np.abs(sampled - impacts.after)) == 0.0
    # the law holds in the normal velocity
    assert np.max(np.abs(impacts.speed_after + 0.8 * impacts.speed_before)) < 1e-14
    for t, state, speed in zip(
        impacts.time, impacts.before, impacts.speed_before, strict=True
    ):
        assert float(normal_velocity(system, t, state)[0]) == float(speed)
