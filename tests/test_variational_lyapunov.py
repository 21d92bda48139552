"""Lyapunov exponents: sum rule, multipliers, and motions that stick."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from textbook_systems import parameters

import jaxcam
import variational
from jaxcam.hybrid import Settings
from jaxcam.models import (
    BilinearOscillator,
    DryFrictionOscillator,
    ImpactOscillator,
    ReliefValve,
)
from variational._lyapunov import _in_turn
from variational._spectrum import LyapunovSpectrum, standard_error


# omega, wall: one impact a turn, and chaos
LANES = np.array([2.8, 3.2, 3.5, 3.8])


def _system(damping):
    return ImpactOscillator(
        **parameters(omega=2.8, restitution=0.8, wall=-0.2, damping=damping)
    )


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_sum_rule_on_chaotic_and_periodic_motions(damping):
    """l1 + l2 = -2 zeta + 2 ln r x (impacts per unit time), to 1e-10."""
    made = variational.lyapunov_spectrum(
        _system(damping),
        [-0.9, 0.0],
        200,
        transient=50,
        where=lambda s: s.omega,
        values=LANES,
    )
    assert np.all(np.asarray(made.code) == 0)
    exact = -2 * damping + 2 * np.log(0.8) * np.asarray(made.impact_rate)
    np.testing.assert_allclose(made.exponents.sum(axis=1), exact, atol=1e-10)
    if damping:
        largest = np.asarray(made.exponents)[:, 0]
        error = np.asarray(made.stderr)[:, 0]
        # a motion of either kind, by many standard errors
        assert largest[0] < -0.05 and np.any(largest > 5 * error)
        np.testing.assert_allclose(
            made.running[:, -1], made.exponents, atol=1e-12, rtol=0
        )


def test_exponents_of_a_periodic_orbit_are_those_of_its_multipliers():
    system = _system(0.02)
    settled = variational.lyapunov_spectrum(system, [-0.9, 0.0], 400, transient=400)
    orbit = variational.orbit_of(system, settled.state)
    sizes = np.abs(np.asarray(orbit.multipliers))
    exact = np.log(sizes) / float(orbit.period)
    # the frame turns with a complex pair: what it adds is bounded by the number of
    # turns
    np.testing.assert_allclose(settled.exponents, exact, atol=3 / 400)
    np.testing.assert_allclose(settled.exponents.sum(), exact.sum(), atol=1e-10)
    assert np.all(np.abs(settled.exponents - exact) < 3 * settled.stderr)
    words = str(settled)
    assert f"{float(settled.exponents[0]):.6g}" in words and "f64" not in words
    assert len(words.splitlines()) == 4 and "<table" in settled._repr_html_()


def _growth(matrix, turns):
    """Logarithms of the growth of a frame over each period of a linear map."""
    frame, logs = np.eye(2), []
    for _ in range(turns):
        frame, upper = np.linalg.qr(matrix @ frame)
        logs.append(np.log(np.abs(np.diag(upper))))
    return np.array(logs)[None]


def test_the_standard_error_contains_the_rotation_of_a_complex_pair():
    """The exponents of 0.55 S R(angle) / S are log(0.55) twice. Blocks of a whole
    number of rotations agree with each other, but not with the truth; the standard
    error still covers the actual error within a factor of 3, and is not 5 times the
    largest error of runs of about this length.
    """
    turn, stretch = 0.2553, np.diag([4.0, 1.0])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    local = _growth(0.55 * stretch @ rotation @ np.linalg.inv(stretch), 624)
    worst = 0.0
    for turns in range(590, 624):
        part = local[:, :turns]
        away = np.abs(part.mean(axis=1) - np.log(0.55))[0, 0]
        error = standard_error(part, 16)[0, 0]
        assert away < 3 * error
        worst = max(worst, away)
    assert standard_error(local[:, :592], 16)[0, 0] < 5 * worst


def test_the_standard_error_of_independent_growth_is_that_of_a_mean():
    """Within 20 % for 400 motions of 480 periods: sigma / sqrt(periods)."""
    local = np.random.default_rng(3).normal(0.3, 2.0, size=(400, 480, 1))
    error = np.mean(standard_error(local, 16))
    assert error == pytest.approx(2 / np.sqrt(480), rel=0.2)


def test_sticking_makes_minus_infinity():
    system = ImpactOscillator(
        **parameters(omega=1.0, restitution=0.1, wall=-1.0, damping=0.1)
    )
    shares = []
    found = variational.lyapunov_spectrum(
        system, [-1.5, 0.0], 200, transient=50, progress=shares.append
    )
    assert int(found.code) == 0
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert np.all(np.isneginf(np.asarray(found.exponents)))


def test_what_does_not_fit_is_refused():
    system = _system(0.0)
    with pytest.raises(ValueError, match="blocks"):
        variational.lyapunov_spectrum(system, [-0.9, 0.0], 10)
    with pytest.raises(ValueError, match="together"):
        variational.lyapunov_spectrum(system, [-0.9, 0.0], values=LANES)
    with pytest.raises(ValueError, match="every motion"):
        variational.lyapunov_spectrum(
            system, jnp.zeros((3, 2)), where=lambda s: s.omega, values=LANES
        )


@pytest.mark.parametrize("lanes", [100, 128, 129, 300])
@pytest.mark.parametrize("each", [True, False])
def test_blocks_of_lanes_are_put_together_in_order(lanes, each):
    """Whether the lanes have a length of a turn each, or one for all."""
    sizes = set()

    def some(batched, states):
        sizes.add(len(states))
        first, turn = states[:, 0], jnp.ones(1) if batched is None else batched
        table = states[:, None, :]
        return LyapunovSpectrum(states, states, first, table, states, turn, first)

    states = jnp.arange(2.0 * lanes).reshape(lanes, 2)
    lengths = jnp.arange(1.0 * lanes) if each else None
    made = _in_turn(some, lengths, states)
    assert len(sizes) == 1 and max(sizes) <= 128
    np.testing.assert_array_equal(made.exponents, states)
    np.testing.assert_array_equal(made.impact_rate, states[:, 0])
    np.testing.assert_array_equal(made.turn, lengths if each else np.ones(1))


@pytest.fixture(scope="module")
def bilinear():
    """Three motions of an oscillator with two stiffnesses."""
    system = BilinearOscillator(
        **parameters(stiffness=4.0, stop=0.0, damping=0.2, amplitude=1.0, omega=1.0)
    )
    omega = np.array([0.5, 1.0, 3.0])
    return (
        system,
        omega,
        variational.lyapunov_spectrum(
            system, [0.1, 0.0], 64, transient=96, where=lambda s: s.omega, values=omega
        ),
    )


def test_sum_rule_with_a_switching_surface(bilinear):
    """The flow contracts areas at a constant rate: to 1e-10."""
    system, _, made = bilinear
    assert np.all(np.asarray(made.code) == 0)
    divergence = float(
        jnp.trace(
            jax.jacfwd(lambda x: system.vector_field(0.0, x))(jnp.array([0.3, 0.2]))
        )
    )
    np.testing.assert_allclose(made.exponents.sum(axis=1), divergence, atol=1e-10)


def test_exponents_of_a_switched_orbit_are_those_of_its_multipliers(bilinear):
    system, omega, made = bilinear
    one = eqx.tree_at(lambda s: s.omega, system, jnp.asarray(omega[1]))
    orbit = variational.orbit_of(one, made.state[1])
    exact = np.log(np.sort(np.abs(np.asarray(orbit.multipliers)))[::-1])
    exact = exact / float(orbit.period)
    np.testing.assert_allclose(made.exponents[1], exact, atol=3 / 64)


def test_sticking_by_dry_friction_makes_minus_infinity():
    """Sticking at zero velocity removes the deviation of the velocity."""
    system = DryFrictionOscillator(**parameters(omega=0.25, friction=0.4))
    made = variational.lyapunov_spectrum(system, [0.5, 0.0], 16, transient=16)
    assert int(made.code) == 0
    assert np.isfinite(made.exponents[0]) and np.isneginf(made.exponents[1])


class _Relay(BilinearOscillator):
    @property
    def hysteresis(self):
        return 0.1


def test_sum_rule_with_hysteresis():
    """The determinant of the saltation matrix is one where the velocity is the same on
    either side, so the exponents add up to -2 damping: to 1e-9.
    """
    system = _Relay(
        **parameters(stiffness=4.0, stop=0.0, damping=0.1, amplitude=1.0, omega=1.0)
    )
    made = variational.lyapunov_spectrum(system, [0.5, 0.0], 32, transient=16)
    assert int(made.code) == 0
    divergence = float(
        jnp.trace(
            jax.jacfwd(lambda x: system.vector_field(0.0, x))(jnp.array([0.3, 0.2]))
        )
    )
    np.testing.assert_allclose(made.exponents.sum(), divergence, atol=1e-9)


def test_hysteresis_is_refused_by_xla():
    with pytest.raises(ValueError, match="only with the LLVM backend"):
        variational.lyapunov_spectrum(
            _Relay(), [0.1, 0.0], 16, settings=Settings(backend="xla")
        )


_BOTH = {
    "impacts": (_system(0.02), [-0.9, 0.0], None),
    "switches": (
        BilinearOscillator(
            **parameters(stiffness=4.0, stop=0.0, damping=0.2, amplitude=1.0, omega=1.0)
        ),
        [0.1, 0.0],
        None,
    ),
    # three states, with impacts on a seat; strongly damped in one direction
    "valve": (ReliefValve(flow=3.0), [0.5, 0.0, 11.0], 1.9),
}


@pytest.mark.parametrize("name", _BOTH)
def test_both_backends_agree(name):
    """LLVM differentiates each attempt, XLA the flow over each period: to 1e-7, except
    for a third exponent, which rounding hides over a period.
    """
    system, start, turn = _BOTH[name]
    llvm, xla = (
        variational.lyapunov_spectrum(
            system,
            start,
            20,
            transient=2,
            blocks=4,
            turn=turn,
            settings=Settings(tolerance=1e-11, backend=backend),
        )
        for backend in ("llvm", "xla")
    )
    assert np.all(np.isfinite(llvm.exponents))
    both = np.asarray(llvm.local)[:, :2], np.asarray(xla.local)[:, :2]
    np.testing.assert_allclose(*both, atol=1e-7)
    np.testing.assert_allclose(llvm.state, xla.state, atol=1e-8)
    assert float(llvm.impact_rate) == float(xla.impact_rate)


def test_strong_contraction_is_resolved():
    """The sum of the exponents of the valve, far below the rounding error of one
    period, is the mean divergence along the motion and the impacts: to 1e-5, the error
    of the mean from 400 000 samples.
    """
    valve, start, turn = ReliefValve(flow=3.0), [0.5, 0.0, 11.0], 20.0
    made = variational.lyapunov_spectrum(
        valve, start, 16, transient=4, blocks=4, turn=turn
    )
    t0, t1 = 4 * turn, 20 * turn
    run = jaxcam.simulate(valve, start, 0.0, t1)
    times = np.linspace(t0, t1, 400_001)
    states = np.asarray(run.at(times))
    rates = -1.25 - 20 * states[:, 0] / (2 * np.sqrt(states[:, 2]))
    mean = np.mean((rates[1:] + rates[:-1]) / 2)
    hits = np.asarray(run.impacts.time)
    count = np.sum((hits > t0) & (hits <= t1))
    exact = mean + 2 * count * np.log(0.8) / (t1 - t0)
    assert exact * turn < -80
    np.testing.assert_allclose(float(made.exponents.sum()), exact, atol=1e-5)


def test_a_slow_impact_leaves_an_exponent_finite():
    """An impact at the speed v stretches one direction by about 1/v and compresses the
    other as much; the sum rule holds to 1e-9. The start is computed backwards from the
    impact.
    """
    system = ImpactOscillator(
        **parameters(omega=3.5, restitution=0.8, wall=-0.2, damping=0.02)
    )
    for speed in (1e-4, 1e-5):
        back = solve_ivp(
            lambda t, x: np.asarray(system.vector_field(t, jnp.array(x))),
            [0.9, 0.0],
            [-0.2, speed],
            rtol=1e-12,
            atol=1e-14,
            max_step=0.05,
        )
        made = variational.lyapunov_spectrum(
            system, back.y[:, -1], 4, transient=0, blocks=2
        )
        exact = -0.04 + 2 * np.log(0.8) * float(made.impact_rate)
        np.testing.assert_allclose(made.exponents.sum(), exact, atol=1e-9)


def test_xla_says_what_rounding_hides():
    """Over a long period, it knows the first exponent only."""
    made = variational.lyapunov_spectrum(
        ReliefValve(flow=3.0),
        [0.5, 0.0, 11.0],
        4,
        transient=1,
        blocks=2,
        turn=8.0,
        settings=Settings(backend="xla"),
    )
    assert int(made.code) == 0
    assert np.isfinite(made.exponents[0]) and np.isnan(made.exponents[2])


def test_lists_and_what_else_does_not_fit():
    system = _system(0.02)
    made = variational.lyapunov_spectrum(
        system, [-0.9, 0.0], 16, where="omega", values=[3.4, 3.5], transient=1
    )
    assert made.exponents.shape == (2, 2)
    for wrong, match in (
        (dict(transient=-1), "transient is -1"),
        (dict(turn=0.0), "turn is 0"),
    ):
        with pytest.raises(ValueError, match=match):
            variational.lyapunov_spectrum(system, [-0.9, 0.0], 16, **wrong)
    with pytest.raises(ValueError, match="no motions"):
        variational.lyapunov_spectrum(system, np.zeros((0, 2)), 16)
