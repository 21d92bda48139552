"""Orbits, saltation and monodromy matrices against closed forms.

"Relative" is relative to the largest entry of what is compared with.
"""

import jax
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from scipy.linalg import expm
from textbook_systems import parameters, TwoStops

import variational
from jaxcam import HybridSystem, Settings
from jaxcam.models import BouncingBall, CamFollower, ImpactOscillator, rpm_to_rad_s


# omega, restitution, impacts every n periods
SETS = [
    (2.8, 0.8, 1),
    (2.6, 0.8, 1),
    (2.5, 0.6, 1),
    (2.2, 0.5, 1),
    (4.3, 0.6, 2),
    (3.7, 0.8, 2),
    (1.8, 0.7, 1),
]


def closed_form(omega, r, wall, n, lib=np):
    """Speed and phase of the impact, and the trace, of the undamped P(1, n) orbit."""
    gamma, period = 1 / (1 - omega**2), 2 * lib.pi * n / omega
    c, s = lib.cos(period), lib.sin(period)
    k, m = (1 + r) * c_half(period, lib) / 2, (1 - r) / (2 * omega)
    square = k**2 + m**2
    root = lib.sqrt((k * wall) ** 2 - square * (wall**2 - gamma**2))
    found = []
    for speed in ((-k * wall + root) / square, (-k * wall - root) / square):
        # x = gamma cos(theta) and x' at the impact, whatever the sign of gamma
        angle = lib.arctan2 if lib is np else lib.atan2
        phase = angle(-m * speed / gamma, (wall + k * speed) / gamma)
        trace = -2 * r * c + (1 + r) ** 2 * (1 - omega**2) * (1 + c) / 2
        trace -= (1 + r) * s * omega**2 * wall / speed
        found.append((speed, phase, trace))
    return found


def c_half(period, lib):
    return lib.cos(period / 2) / lib.sin(period / 2)


def impact_oscillator(**values):
    return ImpactOscillator(**parameters(**values))


def stays_inside(omega, wall, speed, phase, r, n):
    """Whether the closed form lies below the wall between its impacts."""
    gamma, t0 = 1 / (1 - omega**2), phase / omega
    t = t0 + np.linspace(1e-3, 1 - 1e-3, 2000) * 2 * np.pi * n / omega
    a = wall - gamma * np.cos(omega * t0)
    b = -r * speed + gamma * omega * np.sin(omega * t0)
    x = gamma * np.cos(omega * t) + a * np.cos(t - t0) + b * np.sin(t - t0)
    return np.all(x < wall)


@pytest.mark.parametrize("omega, r, n", SETS)
def test_trace_and_determinant_of_one_impact_orbits(omega, r, n):
    tried = 0
    for wall in (-0.05, 0.0, 0.05):
        for speed, phase, trace in closed_form(omega, r, wall, n):
            if speed <= 0.02 or not stays_inside(omega, wall, speed, phase, r, n):
                continue
            system = impact_oscillator(omega=omega, restitution=r, wall=wall)
            period = n * float(system.period)
            orbit = variational.orbit_of(
                system, [wall, -r * speed], period, phase / omega
            )
            assert [e.kind for e in orbit.signature] == ["impact"]
            assert abs(float(orbit.impacts.before[0, 1]) - speed) < 1e-11
            assert ("unstable" in str(orbit)) == (not orbit.stable)
            matrix = variational.monodromy(system, orbit)
            size = 1 + abs(trace)
            assert abs(float(jnp.trace(matrix)) - trace) < 1e-10 * size
            assert abs(float(orbit.determinant) - r**2) < 1e-12
            assert abs(float(jnp.linalg.det(matrix)) - r**2) < 1e-10 * size
            multipliers = np.asarray(variational.floquet_multipliers(system, orbit))
            exact = np.roots([1.0, -trace, r**2])
            exact = exact[np.argsort(-np.abs(exact), kind="stable")]
            assert np.abs(np.poly(multipliers) - np.poly(exact)).max() < 1e-10 * size
            tried += 1
    assert tried


def test_fold_and_flip_are_zeros_of_the_test_functions():
    omega, r = 2.8, 0.8
    gamma, period = 1 / (1 - omega**2), 2 * np.pi / omega
    c, s = np.cos(period), np.sin(period)
    k, m = (1 + r) / np.tan(period / 2) / 2, (1 - r) / (2 * omega)
    rho = 1 + r**2 - 2 * r * c + (1 + r) ** 2 * (1 - omega**2) * (1 + c) / 2
    rho /= (1 + r) * s * omega**2
    flip = rho * abs(gamma) / np.hypot(rho + k, m)
    found = []
    for wall in (flip - 1e-3, flip, flip + 1e-3):
        speed, phase, _ = max(closed_form(omega, r, wall, 1))
        system = impact_oscillator(omega=omega, restitution=r, wall=wall)
        orbit = variational.orbit_of(system, [wall, -r * speed], None, phase / omega)
        found.append(variational.stability(system, orbit))
    assert abs(float(found[1].flip)) < 1e-10
    assert float(found[0].flip) * float(found[2].flip) < 0
    assert abs(found[1].multipliers[0] + 1) < 1e-9
    # nothing else happens there
    assert min(abs(float(f.fold)) for f in found) > 1e-2
    assert all(0 < float(f.scale) < 1 and f.reason == "" for f in found)
    vector = np.asarray(found[1].vectors[:, 0])
    matrix = np.asarray(variational.monodromy(system, orbit))
    assert np.abs(matrix @ vector + vector).max() < 1e-2


@pytest.mark.parametrize("speed", [1e-2, 1e-4, 1e-6])
def test_multipliers_near_grazing_against_fifty_digits(speed):
    """At speeds down to 1e-6; the larger multiplier grows like one over the speed."""
    omega, r = 2.8, 0.8
    with mpmath.workdps(50):
        w, e = mpmath.mpf(omega), mpmath.mpf(r)
        gamma, period = 1 / (1 - w**2), 2 * mpmath.pi / w
        k, m = (1 + e) * mpmath.cot(period / 2) / 2, (1 - e) / (2 * w)
        # the wall for this speed, rounded; then everything for the rounded wall
        wall = float(-k * speed + mpmath.sqrt(gamma**2 - (m * speed) ** 2))
        hit, phase, trace = min(
            closed_form(w, e, mpmath.mpf(wall), 1, mpmath), key=lambda f: abs(f[0])
        )
        large = trace / 2 + mpmath.sign(trace) * mpmath.sqrt(trace**2 / 4 - e**2)
        exact = [float(large), float(e**2 / large)]
        hit, start = float(hit), float(phase / w)
    system = impact_oscillator(omega=omega, restitution=r, wall=wall)
    orbit = variational.orbit_of(system, [wall, -r * hit], None, start)
    found = np.asarray(orbit.multipliers)
    assert np.all(found.imag == 0)
    # the wall is known to rounding only, and the speed to rounding over itself
    np.testing.assert_allclose(found.real, exact, rtol=2e-13 / speed)
    state = variational.stability(system, orbit)
    # bounded, and on the same side at all three speeds: no flip in between
    assert 0.01 < abs(float(state.flip)) < 100
    assert np.sign(float(state.flip)) == np.sign(1 + exact[0]) * 1.0
    assert 0.1 < float(state.scale) / speed < 10


def test_damped_oscillator_by_matrix_exponential():
    """x'' + c x' + k x = A cos(w t) below a wall: det = e^2 exp(-c T), M = E S."""
    c, omega, wall, r = 0.1, 1.0, 1.0, 0.8
    generator = np.array([[0, 1], [-1, -c]])
    period = 2 * np.pi / omega
    shift = expm(generator * period)
    # in units of the amplitude: x / A, wall / A
    for speed in (0.5, 2.0):
        start = np.array([wall, -r * speed])
        free = np.linalg.solve(
            np.eye(2) - shift, np.array([wall, speed]) - shift @ start
        )
        amplitude = np.hypot(free[0], free[1] / omega)
        amplitude *= np.hypot(1 - omega**2, omega * c)
        # the phase at which the steady motion passes through `free`
        gain = amplitude / (1 - omega**2 + 1j * omega * c)
        phase = np.angle((free[0] - 1j * free[1] / omega) / gain)
        scale = amplitude
        system = impact_oscillator(
            omega=omega, restitution=r, wall=wall / scale, damping=c / 2
        )
        orbit = variational.orbit_of(
            system, start / scale, period, phase / omega, closure=1e-9
        )
        assert [e.kind for e in orbit.signature] == ["impact"]
        before = amplitude * np.cos(phase) - wall - c * speed
        after = amplitude * np.cos(phase) - wall + c * r * speed
        saltation = np.array([[-r, 0], [(after + r * before) / speed, -r]])
        exact = shift @ saltation
        found = np.asarray(orbit.monodromy)
        assert abs(np.trace(found) - np.trace(exact)) < 1e-10 * np.abs(exact).max()
        assert abs(float(orbit.determinant) - r**2 * np.exp(-c * period)) < 1e-12


# --- two ways


@pytest.mark.slow
def test_both_ways_over_a_hundred_impacts_and_in_all_variables():
    omega, r, wall = 2.8, 0.8, -0.2
    speed, phase, _ = max(closed_form(omega, r, wall, 1))
    system = impact_oscillator(omega=omega, restitution=r, wall=wall)
    where = lambda s: (s.omega, s.wall, s.restitution, s.damping)
    for turns in (1, 100):
        orbit = variational.orbit_of(
            system,
            [wall, -r * speed],
            turns * float(system.period),
            phase / omega,
            settings=Settings(tolerance=1e-13),
        )
        assert int(orbit.impacts.count) == turns
        product = variational.turn_derivative(system, orbit, where)
        flow = variational.turn_derivative(
            system,
            orbit,
            where,
            method="flow",
            settings=Settings(tolerance=1e-13),
        )
        for name in ("state", "period", "phase", "parameters"):
            one, other = getattr(product, name), getattr(flow, name)
            size = np.abs(np.asarray(other)).max()
            assert np.abs(np.asarray(one - other)).max() < 1e-9 * size
        # complex multipliers of modulus r: errors of factors are hardly amplified
        assert 1 <= float(product.condition) < 20 * turns


@pytest.mark.slow
def test_a_sticking_orbit_has_forgotten_where_it_came_from():
    system = CamFollower(speed=rpm_to_rad_s(140.0))
    period = float(system.period)
    where = lambda s: s.stiffness
    orbit = variational.orbit_of(system, settled_state(system), period, 0.0)
    kinds = [e.kind for e in orbit.signature]
    assert kinds[-2:] == ["stick", "release"] and orbit.sticks
    found = variational.stability(system, orbit)
    assert np.all(np.asarray(found.multipliers) == 0)
    assert "sticks" in found.reason
    product = variational.turn_derivative(system, orbit, where)
    flow = variational.turn_derivative(system, orbit, where, method="flow")
    assert np.all(np.asarray(product.state) == 0)
    # what remains of the past in the loop is its rounding
    assert np.abs(np.asarray(flow.state)).max() < 1e-12
    for name in ("period", "phase", "parameters"):
        one, other = np.asarray(getattr(product, name)), getattr(flow, name)
        assert np.abs(one - np.asarray(other)).max() < 1e-7 * np.abs(one).max()


def settled_state(system):
    """State at time zero of the orbit released last from contact."""
    from jaxcam import simulate

    period = float(system.period)
    turn = simulate(system, None, -2 * period, 0.0)
    return turn.final


# --- saltation


def test_saltation_of_a_ball_and_of_the_oscillator():
    ball = BouncingBall(**parameters(gravity=9.81, restitution=0.7, amplitude=0.0))
    found = variational.saltation_matrix(ball, 0.3, jnp.array([0.0, -2.0]))
    exact = np.array([[-0.7, 0.0], [-(1 + 0.7) * 9.81 / -2.0, -0.7]])
    np.testing.assert_allclose(found, exact, atol=1e-14)
    for damping in (0.0, 0.3):
        system = impact_oscillator(
            omega=2.5, restitution=0.6, wall=0.1, damping=damping
        )
        t, speed = 0.4, 0.7
        found = variational.saltation_matrix(system, t, jnp.array([0.1, speed]))
        exact = (1 + 0.6) * (np.cos(2.5 * t) - 0.1) / speed
        np.testing.assert_allclose(found[1, 0], exact, atol=1e-13)


def test_saltation_of_a_moving_floor_is_that_of_its_frame():
    """Seen from the floor the ball falls with gravity less the floor's acceleration."""
    gravity, r, amplitude, frequency = 9.81, 0.6, 0.01, 40.0
    system = BouncingBall(
        **parameters(
            gravity=gravity,
            restitution=r,
            amplitude=amplitude,
            frequency=frequency,
        )
    )
    t, speed = 0.1, -1.3
    floor = amplitude * np.sin(frequency * t)
    rising = amplitude * frequency * np.cos(frequency * t)
    fall = gravity - amplitude * frequency**2 * np.sin(frequency * t)
    found = variational.saltation_matrix(system, t, jnp.array([floor, rising + speed]))
    exact = np.array([[-r, 0.0], [-(1 + r) * fall / speed, -r]])
    np.testing.assert_allclose(found, exact, atol=1e-12)


def test_saltation_with_four_states_and_two_stops():
    """S d - d is along the jump and what it does to the forces; det S = r^2."""
    values = dict(omega=1.9, stop=0.1, restitution=0.5, force=1.0)
    system = TwoStops(**parameters(**values, stiffness=4.0, damping=0.3))
    r = 0.5
    for side in (0, 1):
        state = np.array([0.02, -0.03, 0.4, 0.9])
        state[side] = 0.1
        found = np.asarray(
            variational.saltation_matrix(system, 0.7, jnp.asarray(state), side)
        )
        v = state[2 + side]
        jump = np.zeros(4)
        jump[2 + side] = -(1 + r) * v
        # linear system: F(x + jump) - F(x) = K jump
        generator = np.array(
            [[0, 0, 1, 0], [0, 0, 0, 1], [-8, 4, -0.3, 0.3], [4, -4, 0.3, -0.3]]
        )
        drive = np.array([0, 0, 1, 1]) * np.cos(1.9 * 0.7)
        law = np.eye(4)
        law[2 + side, 2 + side] = -r
        before = generator @ state + drive
        after = generator @ (state + jump) + drive
        normal = np.zeros(4)
        normal[side] = -1.0
        exact = law + np.outer(after - law @ before, normal) / -v
        np.testing.assert_allclose(found, exact, atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(found), r**2, rtol=1e-12)


def test_second_order_saltation_of_a_ball():
    """The event map of a ball is known in closed form; so are its derivatives."""
    gravity, r = 9.81, 0.7
    ball = BouncingBall(**parameters(gravity=gravity, restitution=r, amplitude=0.0))

    def exact(state):
        height, speed = state
        root = jnp.sqrt(speed**2 + 2 * gravity * height)
        tau = (speed + root) / gravity
        return jnp.stack(
            [-r * root * tau - gravity * tau**2 / 2, r * root + gravity * tau]
        )

    point = jnp.array([0.0, -1.1])
    mapped = variational.event_map(ball, 0.0, point)
    np.testing.assert_allclose(mapped, exact(point), atol=1e-14)
    first = jax.jacfwd(lambda x: variational.event_map(ball, 0.0, x))(point)
    np.testing.assert_allclose(
        first, variational.saltation_matrix(ball, 0.0, point), atol=1e-12
    )
    second = variational.saltation.saltation_second(ball, 0.0, point)
    np.testing.assert_allclose(
        second, jax.jacfwd(jax.jacfwd(exact))(point), rtol=1e-9, atol=1e-12
    )


class Trailer(HybridSystem):
    """A ball on a floor that drags a damped spring along; state (x, x', z).

    The spring's length z follows the velocity, and a plastic impact leaves it alone.
    """

    restitution: jax.Array

    def vector_field(self, t, state):
        return jnp.stack([state[1], -1.0 + 0.2 * state[2], state[1] - 0.5 * state[2]])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state.at[1].multiply(-self.restitution)


def test_entering_contact_drops_the_rank_by_two():
    system = Trailer(**parameters(restitution=0.0))
    speed, z = -0.8, 0.3
    found = variational.saltation.saltation_into_contact(
        system, 0.0, jnp.array([0.0, speed, z])
    )
    # contact begins at the impact, dx / speed later than nominal; z' is -z / 2 after
    # it and speed - z / 2 before it
    exact = np.zeros((3, 3))
    exact[2] = [((-z / 2) - (speed - z / 2)) / speed, 0.0, 1.0]
    np.testing.assert_allclose(found, exact, atol=1e-13)
    release = variational.saltation.saltation_at_release(
        system, 0.0, jnp.array([0.0, 0.0, 5.0])
    )
    np.testing.assert_allclose(release, np.diag([0.0, 0.0, 1.0]), atol=1e-13)


def test_a_graze_is_reported_with_its_limit():
    ball = BouncingBall(**parameters(gravity=9.81, restitution=0.7, amplitude=0.0))
    graze = jnp.array([0.0, 0.0])
    with pytest.raises(ValueError, match="saltation_parts"):
        variational.saltation_matrix(ball, 0.0, graze)
    parts = variational.saltation_parts(ball, 0.0, graze)
    exact = np.array([[0.0, 0.0], [-(1 + 0.7) * 9.81, 0.0]])
    np.testing.assert_allclose(parts.limit, exact, atol=1e-13)
    slow = jnp.array([0.0, -1e-8])
    close = variational.saltation_parts(ball, 0.0, slow)
    np.testing.assert_allclose(close.limit, exact, atol=1e-7)
    with pytest.raises(ValueError, match="no impact"):
        variational.saltation_matrix(ball, 0.0, jnp.array([0.0, 1.0]))


# --- what is refused


def test_a_state_that_does_not_return_is_refused():
    system = impact_oscillator(omega=2.8, restitution=0.8, wall=-0.2)
    with pytest.raises(ValueError, match="does not return.*difference is"):
        variational.orbit_of(system, [-0.9, 0.0])
    with pytest.raises(ValueError, match="period"):
        variational.orbit_of(system, [-0.9, 0.0], -1.0)


@pytest.mark.usefixtures("unchecked_types")
def test_an_unknown_method_is_refused():
    system = impact_oscillator(omega=2.8, restitution=0.8, wall=-0.2)
    speed, phase, _ = max(closed_form(2.8, 0.8, -0.2, 1))
    orbit = variational.orbit_of(system, [-0.2, speed], None, phase / 2.8)
    with pytest.raises(ValueError, match='"product" or "flow"'):
        variational.monodromy(system, orbit, method="guess")


def test_multipliers_of_any_size():
    matrix = np.diag([3.0, -0.5, 0.1]) + np.triu(np.ones((3, 3)), 1)
    found = np.asarray(variational.orbits.eigenvalues(jnp.asarray(matrix)))
    np.testing.assert_allclose(found, [3.0, -0.5, 0.1], atol=1e-12)
    fold, flip, pairs = variational.floquet.test_functions(jnp.asarray(found))
    np.testing.assert_allclose(fold, 2.0 * -1.5 * -0.9, atol=1e-12)
    np.testing.assert_allclose(flip, 4.0 * 0.5 * 1.1, atol=1e-12)
    np.testing.assert_allclose(pairs, -2.5 * -0.7 * -1.05, atol=1e-12)
    turned = jax.jit(variational.orbits.eigenvalues)(
        jnp.array([[0.0, -2.0], [0.5, 0.0]])
    )
    np.testing.assert_allclose(turned, [1j, -1j], atol=1e-15)
