"""Filippov systems: crossing, sliding, leaving, their derivatives, and their models."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

import continuation
import jaxcam
from jaxcam.filippov import equivalent_control, FilippovSystem
from jaxcam.filippov.modes import region, sliding_field
from jaxcam.hybrid import flow, Settings, stroboscope
from jaxcam.hybrid.record import SwitchKind
from jaxcam.models import (
    BeltOscillator,
    PiecewiseLinear,
    planar_stability,
    RelayFeedback,
)
from jaxcam.timestepping import relay_steps, RelaySystem
from variational import switching_saltation


CROSSES, SLIDES, LEAVES = SwitchKind
SHARP = Settings(tolerance=1e-12)
COARSE = Settings(tolerance=1e-8)


def largest(found, expected=0.0):
    """Largest deviation from what is expected."""
    return np.max(np.abs(np.asarray(found) - np.asarray(expected)))


class Level(FilippovSystem):
    """x = sin t as a plane motion, and a level that changes nothing."""

    level: float

    def above(self, t, state):
        del t
        return jnp.stack([state[1], -state[0]])

    def below(self, t, state):
        return self.above(t, state)

    def switching(self, t, state):
        del t
        return state[0] - self.level


@pytest.mark.parametrize("power", range(1, 7))
def test_no_crossing_is_leapt_over(power):
    """sin t crosses 1 - eps 14 times on [0, 40], however short the visits are."""
    eps = 10.0**-power
    run = jaxcam.simulate(Level(1 - eps), [0.0, 1.0], 0.0, 40.0)
    assert run.successful
    rise = np.arcsin(1 - eps)
    exact = np.sort(
        [2 * np.pi * k + part for k in range(7) for part in (rise, np.pi - rise)]
    )
    assert run.switches.count == 14
    # s; the accuracy of the run over the slope of the level
    assert np.max(np.abs(run.switches.time - exact)) < 1e-8 / np.sqrt(eps)
    assert np.array_equal(run.switches.direction, [1, -1] * 7)
    assert largest(run.switches.kind, CROSSES) == 0


def test_a_touch_from_above_is_no_switch():
    run = jaxcam.simulate(Level(-1 - 1e-9), [0.0, 1.0], 0.0, 20.0, settings=SHARP)
    assert run.switches.count == 0
    exact = np.stack([np.sin([3.0, 17.5]), np.cos([3.0, 17.5])], axis=1)
    assert np.max(np.abs(run.at(jnp.array([3.0, 17.5])) - exact)) < 1e-8


def test_coulomb_friction_in_closed_form():
    """Slip on circles about -f and f, stick at the belt's speed, release at x = f."""
    f, belt = 0.4, 0.3
    system = BeltOscillator(belt=belt, friction=f, weakening=0.0)
    x0, v0 = -0.9, 0.5
    run = jaxcam.simulate(system, [x0, v0], 0.0, 6.0, settings=SHARP)
    # x = -f + a cos(t - p) until the velocity has fallen to the belt's
    a, p = np.hypot(x0 + f, v0), np.arctan2(v0, x0 + f)
    first = brentq(lambda t: -a * np.sin(t - p) - belt, 0.0, 3.0)
    x1 = -f + a * np.cos(first - p)
    assert run.switches.time[0] == pytest.approx(first, abs=1e-9)
    assert abs(x1) < f
    released = first + (f - x1) / belt
    assert run.switches.time[1] == pytest.approx(released, abs=1e-9)
    assert run.switches.kind[:2].tolist() == [SLIDES, LEAVES]
    assert run.switches.direction[1] == -1
    assert run.sliding()[0] == pytest.approx([first, released], abs=1e-9)
    # then a turn about f with the belt's speed as its radius
    times = released + np.array([0.5, 1.5])
    exact = f + belt * np.sin(times - released)
    assert np.max(np.abs(run.at(times)[:, 0] - exact)) < 1e-8


def test_stick_slip_by_another_integrator():
    """Stribeck friction: slip by DOP853 with its own event, one whole cycle."""
    system = BeltOscillator(belt=0.2, friction=1.0, weakening=3.0)
    run = jaxcam.simulate(system, [1.0, 0.2], 0.0, 30.0, settings=SHARP)

    def slip(t, s):
        return [s[1], 1 / (1 + 3 * (0.2 - s[1])) - s[0]]

    def back(t, s):
        return s[1] - 0.2

    back.terminal, back.direction = True, 1  # pyright: ignore
    free = solve_ivp(
        slip,
        (0, 20),
        [1.0, 0.2 - 1e-14],
        method="DOP853",
        events=back,
        rtol=1e-12,
        atol=1e-13,
    )
    stick = (1 - free.y[0, -1]) / 0.2
    period = free.t[-1] + stick
    phases = run.sliding()[:2]
    assert largest(np.diff(phases), stick) < 1e-8
    assert largest(phases[1] - phases[0], period) < 1e-8
    # every release is at the same state: the cycle forgets
    leaves = np.asarray(run.switches.kind) == LEAVES
    assert largest(run.switches.after[leaves], [1.0, 0.2]) < 1e-12


def test_convex_method_is_the_equivalent_control():
    """Filippov's field and Utkin's, and the force of friction that holds the mass."""
    system = BeltOscillator(belt=0.3, amplitude=0.4, omega=1.3, damping=0.1)
    t, state = jnp.asarray(0.7), jnp.array([0.35, 0.3])
    u, field = equivalent_control(system, t, state)
    assert np.max(np.abs(field - sliding_field(system, t, state))) < 1e-15
    assert largest(field, [0.3, 0.0]) < 1e-15
    held = 0.35 + 0.2 * 0.3 - 0.4 * np.cos(1.3 * 0.7)
    assert -float(u) * 1.0 == pytest.approx(held, abs=1e-14)


@pytest.mark.parametrize(
    ("x", "name"), [(0.5, "sliding"), (2.0, "crossing down"), (-2.0, "crossing up")]
)
def test_regions_of_the_surface(x, name):
    assert region(BeltOscillator(), 0.0, jnp.array([x, 0.2])) == name


def test_tangent_and_escaping():
    assert region(BeltOscillator(), 0.0, jnp.array([1.0, 0.2])) == "tangent"
    runaway = RelayFeedback([[0.0]], [-1.0], [1.0])
    assert region(runaway, 0.0, jnp.array([0.0])) == "escaping"
    # the motion is not unique; `sides` chooses the positive side
    run = jaxcam.simulate(runaway, [0.0], 0.0, 1.0)
    assert float(run.final[0]) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="shapes"):
        RelayFeedback(np.eye(2), [1.0], [1.0])


# Relay feedback: a third-order plant that oscillates.

PLANT = np.array([[-3.0, 1.0, 0.0], [-3.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
INPUT, OUTPUT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def test_relay_oscillation_in_closed_form():
    """1/(s + 1)^3: half a period h solves c (I + e^Ah)^-1 (e^Ah - I) A^-1 b = 0.

    (K. J. Astrom, Oscillations in systems with relay feedback, 1995)
    """

    def condition(h):
        e = expm(PLANT * h)
        inner = (e - np.eye(3)) @ np.linalg.solve(PLANT, INPUT)
        return OUTPUT @ np.linalg.solve(np.eye(3) + e, inner)

    half = brentq(condition, 1.6, 3.0, xtol=1e-13)
    system = RelayFeedback(PLANT, INPUT, OUTPUT)
    run = jaxcam.simulate(system, [1.0, 0.0, 0.0], 0.0, 80.0, settings=SHARP)
    assert run.successful
    assert np.max(np.abs(np.diff(run.switches.time)[-4:] - half)) < 1e-7
    # multipliers: one, and those of half a turn, projected along its last velocity
    end, side = np.asarray(run.switches.before[-1]), -float(run.switches.direction[-1])
    velocity = PLANT @ end - side * INPUT
    onto = np.eye(3) - np.outer(velocity, OUTPUT) / (OUTPUT @ velocity)
    exact = np.linalg.eigvals(onto @ expm(PLANT * half)) ** 2
    # from a start off the surface
    t0 = float(run.switches.time[-3]) + 0.5
    (start,) = run.at(jnp.array([t0]))
    turn = _jacobian(system, start, t0, t0 + 2 * half)
    values = np.linalg.eigvals(np.asarray(turn))
    assert np.min(np.abs(values - 1)) < 1e-6
    assert largest(np.sort(np.abs(values))[:2], np.sort(np.abs(exact))[1:]) < 1e-6


def test_relay_by_steps_and_by_events():
    """Backward Euler with relays tends to the event-driven motion, with order one."""
    plant = np.array([[0.0, 1.0], [-1.0, -0.2]])
    system = RelayFeedback(plant, [0.0, 0.4], [0.5, 1.0])
    exact = jaxcam.simulate(system, [2.0, 0.0], 0.0, 6.0)
    assert len(exact.sliding())
    stepped = RelaySystem(plant, np.array([[0.0], [0.4]]), np.array([[0.5, 1.0]]))
    errors = []
    for steps in (1000, 2000, 4000):
        motion = relay_steps(stepped, [2.0, 0.0], 6.0, steps)
        every = steps // 200
        states = exact.at(motion.time[::every])
        errors.append(np.max(np.abs(motion.state[::every] - states)))
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.max(np.abs(rates - 1)) < 0.15


# Derivatives.


@pytest.fixture(scope="module")
def forced():
    """A forced belt oscillator, on its attractor with one stretch of sticking."""
    system = BeltOscillator(
        belt=0.5, friction=0.4, weakening=0.0, damping=0.05, amplitude=0.9, omega=0.7
    )
    run = jaxcam.simulate(system, [0.0, 0.0], 0.0, 40 * float(system.period))
    return system, run.final


@eqx.filter_jit
def _end(system, state, t0, t1):
    return flow(system, state, t0, t1, settings=SHARP).state


@eqx.filter_jit
def _jacobian(system, state, t0, t1):
    return jax.jacfwd(lambda x: flow(system, x, t0, t1, settings=SHARP).state)(state)


def _product(system, state, period):
    """Matrix exponentials of slip and stick, and the saltation matrices."""
    slip = np.array([[0.0, 1.0], [-1.0, -2 * float(system.damping)]])
    stick = np.array([[0.0, 1.0], [0.0, 0.0]])
    run = jaxcam.simulate(system, state, 0.0, period, settings=SHARP)
    switches = run.switches
    assert set(np.asarray(switches.kind).tolist()) >= {SLIDES, LEAVES}
    side, t, product = float(run.steps.sides[0, 0]), 0.0, np.eye(2)
    for k, time in enumerate(np.asarray(switches.time)):
        towards = float(switches.direction[k])
        after = 0.0 if switches.kind[k] == SLIDES else towards
        matrix = switching_saltation(
            system, time, switches.before[k], np.array([side]), after=after
        )
        product = expm((slip if side else stick) * (time - t)) @ product
        product, side, t = np.asarray(matrix) @ product, after, time
    return expm((slip if side else stick) * (period - t)) @ product


def test_multipliers_with_sliding_agree_with_differences(forced):
    """Entering and leaving: the monodromy matrix, three ways.

    Derivative of the flow against the product of saltation matrices to 1e-9, and
    against central differences to 1e-6.
    """
    system, state = forced
    period, step = float(system.period), 1e-5
    assert largest(_end(system, state, 0.0, period), state) < 1e-6
    matrix = np.asarray(_jacobian(system, state, 0.0, period))
    assert largest(matrix, _product(system, state, period)) < 1e-9
    for unit, column in zip(np.eye(2), matrix.T, strict=True):
        ends = [_end(system, state + s * step * unit, 0.0, period) for s in (1, -1)]
        assert largest((ends[0] - ends[1]) / (2 * step), column) < 1e-6
    # sliding leaves a zero
    assert np.min(np.abs(np.linalg.eigvals(matrix))) < 1e-9


def test_a_stroboscope_of_a_filippov_system(forced):
    """The state after one forcing period, for two belt speeds at once, to 1e-7."""
    system, state = forced
    speeds = jnp.array([0.5, 0.6])
    batch = stroboscope(system, state, 1, where=lambda s: s.belt, values=speeds)
    for k, belt in enumerate(speeds):
        one = eqx.tree_at(lambda s: s.belt, system, belt)
        assert (
            largest(batch.states[k, -1], _end(one, state, 0.0, float(system.period)))
            < 1e-7
        )


def test_a_periodic_orbit_of_a_filippov_system(forced):
    """Its multipliers are those of the saltation matrices, to 1e-6."""
    system, state = forced
    orbit = continuation.periodic_orbit(system, state, periods=1)
    assert [event.kind for event in orbit.signature].count("slide") == 1
    expected = np.linalg.eigvals(_product(system, state, float(system.period)))
    found = np.sort(np.abs(np.asarray(orbit.multipliers)))
    assert largest(found, np.sort(np.abs(expected))) < 1e-6


def test_derivative_by_the_belt_speed(forced):
    """Forward differentiation through the events, against central differences."""
    system, state = forced
    t1, step = 0.8 * float(system.period), 1e-5

    def end(belt):
        moved = eqx.tree_at(lambda s: s.belt, system, belt)
        return _end(moved, state, 0.0, t1)

    _, slope = jax.jvp(end, (jnp.asarray(0.5),), (jnp.ones(()),))
    ends = [end(jnp.asarray(0.5 + s * step)) for s in (1, -1)]
    assert largest((ends[0] - ends[1]) / (2 * step), slope) < 1e-6


def test_saltation_matrices_in_closed_form():
    """Belt oscillator: H_x = (0, 1), so S only changes the second column."""
    system = BeltOscillator(belt=0.3, friction=0.4, weakening=0.0)
    up, down, held = np.array([1.0]), -1.0, 0.0
    state = jnp.array([0.1, 0.3])
    entering = switching_saltation(system, 0.0, state, up, after=held)
    # F- = (v, -x - f), F+ = (v, 0): the deviation of the velocity is lost
    assert largest(entering, [[1, 0], [0, 0]]) < 1e-15
    state = jnp.array([1.0, 0.3])
    across = switching_saltation(system, 0.0, state, up)
    assert largest(across, [[1, 0], [0, (-1 + 0.4) / (-1 - 0.4)]]) < 1e-15
    state, slides = jnp.array([0.4, 0.3]), np.array([held])
    leaving = switching_saltation(system, 0.0, state, slides, after=down)
    assert largest(leaving, np.eye(2)) < 1e-15
    with pytest.raises(ValueError, match="pass the side on which it continues"):
        switching_saltation(system, 0.0, state, slides)


def test_the_saltation_matrix_of_a_crossing_can_be_traced():
    """State and sides, under jit and vmap."""
    system = BeltOscillator(belt=0.3, friction=0.4, weakening=0.0)
    states = jnp.array([[1.0, 0.3], [1.2, 0.3]])
    sides = jnp.array([[1.0], [-1.0]])

    def one(x, side):
        return switching_saltation(system, 0.0, x, side)

    found = jax.jit(jax.vmap(one))(states, sides)
    expected = [one(x, np.asarray(s)) for x, s in zip(states, sides, strict=True)]
    assert largest(found, jnp.stack(expected)) < 1e-15


class Gripped(BeltOscillator):
    """Static friction exceeds kinetic friction."""

    @property
    def holding(self):
        return 1.5


def test_the_field_jumps_where_static_friction_ends():
    """Stuck at belt speed b, released at x = 1.5 f: S = I + (F+ - F-) d_x / (d_x F-).

    d falls with x alone and F- = (b, 0), F+ - F- = (0, f - 1.5 f): S21 = -f / (2 b).
    """
    system = Gripped(belt=0.3, friction=0.4, weakening=0.0)
    state = jnp.array([0.6, 0.3])
    matrix = switching_saltation(system, 0.0, state, np.zeros(1), after=-1.0)
    assert largest(matrix[:, 0], [1.0, -0.4 / 0.6]) < 1e-12


# Theorem 2.2.


def random_pairs(count, seed=7):
    rng = np.random.default_rng(seed)
    minus = rng.normal(size=(count, 2, 2))
    normal = rng.normal(size=(count, 2))
    column = rng.normal(size=(count, 2))
    plus = minus + column[:, :, None] * normal[:, None]
    return minus, plus, normal


def _growth(minus, plus, normal, angle):
    """Mean rate of the logarithm of the size, over the last two thirds of a motion."""
    system = PiecewiseLinear(minus, plus, normal)

    def stretch(x, _):
        end = flow(system, x, 0.0, 3.0, settings=COARSE).state
        size = jnp.linalg.norm(end)
        return end / size, jnp.log(size)

    start = jnp.stack([jnp.cos(angle), jnp.sin(angle)])
    _, logs = jax.lax.scan(stretch, start, length=24)
    return jnp.mean(logs[8:])


def test_theorem_2_2_against_simulation_on_200_pairs():
    """The largest growth over four starts is positive where Theorem 2.2 says so."""
    minus, plus, normal = random_pairs(200)
    angles = np.arange(4) * np.pi / 2 + 0.1
    over = jax.vmap(jax.vmap(_growth, (None, None, None, 0)), (0, 0, 0, None))
    over = eqx.filter_jit(over)
    growth = np.asarray(over(minus, plus, normal, angles))
    assert np.all(np.isfinite(growth))
    verdicts = [
        planar_stability(PiecewiseLinear(*pair)).stable
        for pair in zip(minus, plus, normal, strict=True)
    ]
    assert 20 < sum(verdicts) < 180
    assert np.array_equal(np.max(growth, axis=1) < 0, verdicts)


def test_periodic_planar_system():
    """sigma-/omega- + sigma+/omega+ = 0: every motion closes after pi/w- + pi/w+."""
    minus = np.array([[-0.2, -1.0], [1.0, -0.2]])
    normal = np.array([1.0, 0.0])
    # trace 2 sigma and determinant sigma^2 + omega^2 with sigma = 0.4, omega = 2
    plus = np.array([[1.0, -1.0], [0.0, -0.2]])
    plus[1, 0] = 0.4**2 + 2.0**2 - plus[0, 0] * plus[1, 1]
    target = 2.0
    system = PiecewiseLinear(minus, plus, normal)
    verdict = planar_stability(system)
    assert abs(verdict.growth) < 1e-12
    period = np.pi / 1.0 + np.pi / target
    run = jaxcam.simulate(system, [0.3, 0.4], 0.0, period)
    assert largest(run.final, [0.3, 0.4]) < 1e-8
    assert run.switches.count == 2


def test_theorem_2_2_says_what_it_needs():
    eye = np.eye(2)
    with pytest.raises(ValueError, match="continuous"):
        planar_stability(PiecewiseLinear(-eye, -2 * eye, [1.0, 0.0]))
    with pytest.raises(ValueError, match="observable"):
        planar_stability(PiecewiseLinear(-eye, -eye, [1.0, 0.0]))
    with pytest.raises(ValueError, match="two states"):
        planar_stability(PiecewiseLinear(np.eye(3), np.eye(3), np.ones(3)))
    # both stable on their own, one turning: (a) decides where an eigenvalue is real
    turning = np.array([[-1.0, -2.0], [2.0, -1.0]])
    node = turning + np.outer([-6.0, 0.0], [1.0, 0.0])
    assert np.all(np.isreal(np.linalg.eigvals(node)))
    assert planar_stability(PiecewiseLinear(turning, node, [1.0, 0.0])).stable
    saddle = turning + np.outer([0.0, -6.0], [1.0, 0.0])
    assert np.linalg.det(saddle) < 0
    assert not planar_stability(PiecewiseLinear(turning, saddle, [1.0, 0.0])).stable
