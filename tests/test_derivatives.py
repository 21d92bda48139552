"""Derivatives of trajectories against closed forms, saltation matrices and differences.

"Relative" is relative to the largest entry of what is compared with.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam import HybridSystem, Settings, simulate
from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ConstantRestitution,
    ImpactOscillator,
    rpm_to_rad_s,
)
from variational import saltation_matrix


def assert_relative(found, exact, relative):
    found, exact = np.asarray(found), np.asarray(exact)
    assert found.shape == exact.shape
    assert np.max(np.abs(found - exact)) <= relative * np.max(np.abs(exact))


# --- thirty impacts of the forced oscillator


class Extended(HybridSystem):
    """The undamped oscillator with its parameters as further, constant states."""

    def vector_field(self, t, state):
        x, velocity, omega, _, _ = state
        zero = jnp.zeros_like(x)
        return jnp.stack([velocity, jnp.cos(omega * t) - x, zero, zero, zero])

    def gap(self, t, state):
        return state[4] - state[0]

    def impact(self, t, state):
        return state.at[1].multiply(-state[3])


@jax.jit
def flight(t0, t1, state):
    """Flight in closed form: x = gamma cos(omega t) + free oscillation."""
    x, velocity, omega, _, _ = state
    gamma = 1 / (1 - omega**2)
    a = x - gamma * jnp.cos(omega * t0)
    b = velocity + gamma * omega * jnp.sin(omega * t0)
    c, s = jnp.cos(t1 - t0), jnp.sin(t1 - t0)
    place = gamma * jnp.cos(omega * t1) + a * c + b * s
    speed = -gamma * omega * jnp.sin(omega * t1) - a * s + b * c
    return jnp.stack([place, speed, *state[2:]])


@jax.jit
def next_impact(t, state):
    """The first root of the gap in closed form: a fine scan, then Newton."""
    grid = t + jnp.linspace(1e-3, 6.0, 3000)
    gaps = state[4] - jax.vmap(lambda s: flight(t, s, state)[0])(grid)
    start = grid[jnp.argmax(gaps < 0)]

    def newton(_, s):
        x, velocity = flight(t, s, state)[:2]
        return s + (state[4] - x) / velocity

    return jax.lax.fori_loop(0, 8, newton, start)


_flight_matrix = jax.jit(jax.jacfwd(flight, argnums=2))
_saltation = jax.jit(lambda t, x: saltation_matrix(Extended(), t, x))


def product_of_saltations(t0, t1, state, number):
    """Impact times, their derivatives, the final state and its Jacobian."""
    matrix, t, times, slopes = np.eye(5), t0, [], []
    for _ in range(number):
        hit = float(next_impact(t, state))
        assert hit < t1
        matrix = np.asarray(_flight_matrix(t, hit, state)) @ matrix
        before = flight(t, hit, state)
        # gap = wall - x is kept at zero: dt = d(gap) / velocity
        slopes.append((matrix[4] - matrix[0]) / float(before[1]))
        times.append(hit)
        matrix = np.asarray(_saltation(hit, before)) @ matrix
        state, t = Extended().impact(hit, before), hit
    matrix = np.asarray(_flight_matrix(t, t1, state)) @ matrix
    return np.array(times), np.array(slopes), flight(t, t1, state), matrix


def test_thirty_impacts_against_saltation_matrices():
    # the orbit with one impact a period of (omega, r) = (2.8, 0.8), started nearby
    omega, r, wall, number = 2.8, 0.8, -0.2, 30
    gamma, period = 1 / (1 - omega**2), 2 * np.pi / omega
    k, m = (1 + r) / np.tan(period / 2) / 2, (1 - r) / (2 * omega)
    square = k**2 + m**2
    root = np.sqrt((k * wall) ** 2 - square * (wall**2 - gamma**2))
    speed = (-k * wall + root) / square
    phase = np.arctan2(-m * speed / gamma, (wall + k * speed) / gamma)
    c, s = np.cos(period), np.sin(period)
    trace = -2 * r * c + (1 + r) ** 2 * (1 - omega**2) * (1 + c) / 2
    trace -= (1 + r) * s * omega**2 * wall / speed
    assert abs(trace) < 1 + r**2  # it is stable
    t0 = phase / omega + 0.3
    after = jnp.array([wall, 0.98 * speed * -r, omega, r, wall])
    inputs = flight(phase / omega, t0, after)
    t1 = t0 + (number + 0.3) * period

    def motion(inputs):
        system = ImpactOscillator(
            omega=inputs[2], restitution=inputs[3], wall=inputs[4]
        )
        trajectory = simulate(
            system, inputs[:2], t0, t1, tolerance=1e-14, max_steps=2048
        )
        out = (trajectory.impacts.time[:number], trajectory.final)
        return out, (out, trajectory.impacts.count, trajectory.code)

    jacobians, (values, count, code) = jax.jit(jax.jacfwd(motion, has_aux=True))(inputs)
    times, slopes, final, matrix = product_of_saltations(t0, t1, inputs, number)
    assert int(code) == 0
    assert int(count) == number
    assert np.max(np.abs(values[0] - times)) < 1e-10
    assert np.max(np.abs(values[1] - final[:2])) < 1e-9
    # the state Jacobian, which has shrunk to r^30, by itself; then the parameters
    assert_relative(jacobians[1][:, :2], matrix[:2, :2], 1e-9)
    for column in range(5):
        assert_relative(jacobians[1][:, column], matrix[:2, column], 1e-9)
        assert_relative(jacobians[0][:, column], slopes[:, column], 1e-9)


# --- bouncing ball in closed form


HOPS = 12


def ball_times(p):
    """Impact times of a ball launched from the floor, for p = (gravity, r, speed)."""
    gravity, r, speed = p
    k = jnp.arange(1.0, HOPS + 1)
    return 2 * speed / gravity * (1 - r**k) / (1 - r)


def test_first_and_second_derivatives_of_impact_times():
    point = jnp.array([9.81, 0.7, 3.0])

    def times(p):
        system = BouncingBall(gravity=p[0], restitution=p[1])
        launch = jnp.stack([jnp.zeros_like(p[2]), p[2]])
        trajectory = simulate(system, launch, 0.0, 5.0, max_steps=64)
        # and the time at which it comes to rest, through the completion of chatter
        rest = trajectory.contacts.start[:1]
        return jnp.concatenate([trajectory.impacts.time[:HOPS], rest])

    def exact(p):
        rest = 2 * p[2] / p[0] / (1 - p[1])
        return jnp.concatenate([ball_times(p), rest[None]])

    def first(p):
        values, tangent = times(p), jax.jacfwd(times)(p)
        return tangent, (values, tangent)

    second, (values, slopes) = jax.jit(jax.jacfwd(first, has_aux=True))(point)
    assert np.max(np.abs(values - exact(point))) < 1e-10  # s
    slope, bend = jax.jacfwd(exact)(point), jax.jacfwd(jax.jacfwd(exact))(point)
    for k in range(HOPS + 1):
        assert_relative(slopes[k], slope[k], 1e-9)
        assert_relative(second[k], bend[k], 1e-8 if k == HOPS else 1e-9)


def test_lanes_with_and_without_events():
    """Flight only, one impact, many, chatter to rest, at rest, and rest from a drop."""
    gravity, r, t0, t1 = 9.81, 0.4, 0.2, 1.2
    states = np.array(
        [[9.0, 1.0], [3.0, 0.5], [0.3, -2.0], [0.02, 0.1], [0.0, 0.0], [0.001, 0.0]]
    )

    def motion(state, t0, t1):
        system = BouncingBall(gravity=gravity, restitution=r)
        trajectory = simulate(system, state, t0, t1, max_steps=256)
        final = trajectory.final
        sampled = trajectory.at(jnp.stack([t1]))[0]
        return (final, sampled), (final, trajectory.impacts.count, trajectory.code)

    jacobian = jax.jacfwd(motion, argnums=(0, 1, 2), has_aux=True)
    over_lanes = jax.jit(jax.vmap(jacobian, in_axes=(0, None, None)))
    (slopes, sampled), (final, counts, codes) = over_lanes(
        jnp.asarray(states), jnp.asarray(t0), jnp.asarray(t1)
    )
    assert codes.tolist() == [0] * len(states)
    for leaf in jax.tree.leaves((slopes, sampled)):
        assert np.all(np.isfinite(leaf))

    def closed(p):
        """Final state for p = (height, velocity, t0, t1), after a number of hops."""
        height, velocity, start, end = p[:4]
        left = end - start
        root = jnp.sqrt(velocity**2 + 2 * gravity * height)
        left = left - (velocity + root) / gravity
        speed = r * root
        for _ in range(hops - 1):
            left = left - 2 * speed / gravity
            speed = r * speed
        if hops == 0:
            left, speed, base = end - start, velocity, height
        else:
            base = 0.0
        return jnp.stack(
            [base + left * (speed - gravity * left / 2), speed - gravity * left]
        )

    seen = set()
    for lane, state in enumerate(states):
        hops = int(counts[lane])
        rests = np.all(np.asarray(final[lane]) == 0.0)
        found = np.concatenate(
            [slopes[0][lane], slopes[1][lane][:, None], slopes[2][lane][:, None]],
            axis=1,
        )
        if rests:
            # it has forgotten where it came from
            assert np.all(found == 0.0)
            assert np.all(np.asarray(sampled[0][lane]) == 0.0)
            seen.add("rest" if hops else "contact")
            continue
        exact = jax.jacfwd(closed)(jnp.array([*state, t0, t1]))
        assert_relative(found, exact, 1e-9)
        assert_relative(sampled[0][lane], exact[:, :2], 1e-9)
        seen.add(hops)
    assert {"rest", "contact", 0, 1} <= seen


# --- through chatter, sticking and release


def test_cam_through_chatter_and_sticking_against_differences():
    # speed (rad/s), restitution, stiffness (N/m), relative velocity at the start
    point = jnp.array([rpm_to_rad_s(140.0), 0.4927, 105.0, 0.4])

    def motion(p):
        system = CamFollower(
            speed=p[0], restitution=ConstantRestitution(p[1]), stiffness=p[2]
        )
        # thrown up from the cam: impacts, chatter, contact, release, chatter, contact
        angle, wall = jax.jvp(
            lambda t: system.contact_angle(system.cam_angle(t)),
            (jnp.zeros_like(p[0]),),
            (jnp.ones_like(p[0]),),
        )
        start = jnp.stack([angle, wall + p[3]])
        trajectory = simulate(system, start, 0.0, 1.15, tolerance=1e-13, max_steps=1024)
        contacts, impacts = trajectory.contacts, trajectory.impacts
        out = jnp.concatenate(
            [
                trajectory.final,
                contacts.start[:2],
                contacts.end[:2],
                impacts.time[:2],
                trajectory.at(jnp.array([0.1, 0.75]))[:, 0],
            ]
        )
        return out, (contacts.count, contacts.released[:2], trajectory.code)

    jacobian, (count, released, code) = jax.jit(jax.jacfwd(motion, has_aux=True))(point)
    assert int(code) == 0
    assert int(count) >= 2 and bool(jnp.all(released))
    values = jax.jit(jax.vmap(lambda p: motion(p)[0]))
    for column in range(4):
        width = 1e-3 * float(point[column])
        shifts = np.array([-2.0, -1.0, 1.0, 2.0])
        rows = np.tile(np.asarray(point), (4, 1))
        rows[:, column] += shifts * width
        weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12 * width)
        # of fourth order in the width
        difference = weights @ np.asarray(values(jnp.asarray(rows)))
        exact = np.asarray(jacobian)[:, column]
        assert np.max(np.abs(exact - difference)) < 1e-6 * (1 + np.max(np.abs(exact)))


def test_reverse_is_forward():
    """A ball on a table: impacts, chatter, contact, release and flight once more."""
    # gravity, restitution, amplitude, frequency, height above the table, velocity
    gamma, frequency = 1.5, 31.0
    point = jnp.array(
        [9.81, 0.2, gamma * 9.81 / frequency**2, frequency, 0.005, 0.1],
    )
    settings = Settings(tolerance=1e-6, chatter_depth=1.0)

    def motion(p, derivatives):
        system = BouncingBall(
            gravity=p[0], restitution=p[1], amplitude=p[2], frequency=p[3]
        )
        trajectory = simulate(
            system,
            p[4:],
            0.0,
            0.25,
            settings=settings,
            max_steps=64,
            derivatives=derivatives,
        )
        contacts, impacts = trajectory.contacts, trajectory.impacts
        seen = (impacts.count, contacts.count, contacts.released[0], trajectory.code)
        # one number that every event has a part in
        total = jnp.array([3.0, 1.0]) @ trajectory.final
        total = total + impacts.time[0] + 2 * contacts.start[0] + contacts.end[0]
        return total, seen

    def forward(p):
        return jax.jacfwd(lambda q: motion(q, "forward"), has_aux=True)(p)

    def reverse(p):
        return jax.grad(lambda q: motion(q, "reverse"), has_aux=True)(p)

    ahead, seen = jax.jit(forward)(point)
    back, seen_back = jax.jit(reverse)(point)
    assert [int(s) for s in seen] == [int(s) for s in seen_back]
    hits, contacts, released, code = seen
    assert int(code) == 0 and int(hits) >= 3 and int(contacts) >= 1 and bool(released)
    assert np.all(np.abs(ahead) > 0)
    assert_relative(back, ahead, 1e-12)
    assert np.max(np.abs(back / ahead - 1)) < 1e-11
