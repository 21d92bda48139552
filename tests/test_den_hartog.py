"""The forced oscillator with dry friction against the closed forms of Den Hartog 1931.

`x'' + x = cos(omega t) - friction sgn(x')`. The motion is symmetric: after half a
period, x and the force have changed signs. Without stops, the flight from the upper
turn x = A at the forcing's phase p is, with V = 1 / (1 - omega^2),

    x = V cos(omega t + p) + friction (1 - cos t - U omega sin t),
    V cos p = A,  V sin p = -friction U,  U = tan(pi / (2 omega)) / omega,

so A^2 = V^2 - friction^2 U^2. Its velocity does not change its sign before the lower
turn if A > friction S, where S is the largest value of

    (sin t + U omega (cos omega t - cos t)) / (omega sin omega t),  0 <= t < pi / omega.

The motion without stops ends at friction = |V| / hypot(U, S). At t = 0 the quotient is
1 / omega^2, the condition that the body does not stick at its turn (crossing-sliding);
a larger value at t > 0 means that it stops between its turns (grazing-sliding). The two
curves meet at omega = 1/2 and friction = 1/3, where U = 0.

P. Kowalczyk and P. Piiroinen, Two-parameter sliding bifurcations of periodic solutions
in a dry-friction oscillator, Physica D 237 (2008), followed these bifurcations
numerically. Their printed values were not available, so that the names and places of
the bifurcations are compared with closed forms instead.
"""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar, root

import continuation
from jaxcam import simulate
from jaxcam.hybrid import Settings
from jaxcam.models import DryFrictionOscillator


EXACT = Settings(tolerance=1e-12)


# The turn decides at the first two, a stop between the turns at the others, where
# tan(pi / (2 omega)) is positive and omega < 1.
TURNS, BETWEEN = (0.7, 1.5), (0.42, 0.3)


def response(omega: float) -> tuple[float, float]:
    """V and U of Den Hartog."""
    return 1 / (1 - omega**2), np.tan(np.pi / (2 * omega)) / omega


def needed(omega: float) -> tuple[float, float]:
    """S, the smallest ratio of amplitude to friction without stops, and its time."""
    _, lost = response(omega)

    def quotient(t):
        cosines = np.cos(omega * t) - np.cos(t)
        return (np.sin(t) + lost * omega * cosines) / (omega * np.sin(omega * t))

    times = np.linspace(0.0, np.pi / omega, 2001)[1:-1]
    highest = int(np.argmax(quotient(times)))
    if highest == 0:
        return 1 / omega**2, 0.0
    near = (times[highest - 1], times[highest + 1])
    found = minimize_scalar(
        lambda t: -quotient(t), bounds=near, method="bounded", options={"xatol": 1e-10}
    )
    return -float(found.fun), float(found.x)


def boundary(omega: float) -> float:
    """The largest friction of motion without stops."""
    static, lost = response(omega)
    return abs(static) / np.hypot(lost, needed(omega)[0])


def kinds(omega: float, friction: float) -> list[str]:
    system = DryFrictionOscillator(omega=omega, friction=friction)
    return [event.kind for event in continuation.periodic_orbit(system).signature]


@pytest.mark.parametrize("omega", TURNS + BETWEEN)
def test_the_body_begins_to_stop_at_den_hartogs_friction(omega):
    """A billionth below the limit the orbit does not stick, a billionth above it does:
    at its turns, or between them.
    """
    friction = boundary(omega)
    assert (needed(omega)[1] > 0) == (omega in BETWEEN)
    assert kinds(omega, friction * (1 - 1e-9)) == ["cross"] * 2
    above = kinds(omega, friction * (1 + 1e-9))
    assert above.count("slide") == above.count("leave") == 2
    assert above.count("cross") == (2 if omega in BETWEEN else 0)


def backward_motion_ends(omega: float) -> tuple[float, float, float]:
    """Friction above which the body no longer turns back before it stops, and the
    position and phase of its release there (0 < omega < 1/2).

    The body stops at -A at the instant at which its acceleration is zero: the phase of
    the force is then pi - p, if p is its phase at the release, where A = friction +
    cos p. With these phases, the two equations of `symmetric` have no solution with
    friction, except if the flight lasts one natural period, 2 pi: this gives p and
    then, from x, the friction.
    """
    phase = np.pi / 2 - np.pi * omega
    friction = np.cos(phase) * omega**2 / (1 - omega**2)
    return friction, friction + np.cos(phase), phase


@pytest.mark.parametrize(
    ("omega", "kind"), [(0.54, "crossing-sliding"), (0.42, "grazing-sliding")]
)
def test_a_branch_locates_and_names_the_onset_of_stops(omega, kind):
    """The special point is Den Hartog's friction to 1e-9.

    The orbits that stop between their turns undergo switching-sliding later on, to
    1e-4: one multiplier is 1 there, and Newton's method does not come closer.
    """
    friction = boundary(omega)
    system = DryFrictionOscillator(omega=omega, friction=0.95 * friction)
    orbit = continuation.periodic_orbit(system)
    bounds = (0.94 * friction, 1.14 * friction)
    found = continuation.branch(system, orbit, "friction", bounds)
    onset, *later = found.special
    assert onset.kind == kind and onset.converged
    assert onset.parameter == pytest.approx(friction, abs=1e-9)
    assert [point.kind for point in later] == ["switching-sliding"] * (omega < 0.5)
    for point in later:
        expected, _, _ = backward_motion_ends(omega)
        assert point.parameter == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("omega", [0.42, 0.46])
def test_where_backward_motion_ends(omega):
    """A billionth above this friction, the symmetric orbit stops where it turns, after
    2 pi; a billionth below, it turns back. At this friction, time and place of the stop
    agree to 1e-9.
    """
    friction, at, phase = backward_motion_ends(omega)
    start, half = phase / omega, np.pi / omega
    for size, kind in ((1.0, None), (1 + 1e-9, 1), (1 - 1e-9, 0)):
        if kind is not None:
            guess = (phase, 2 * np.pi)
            at, release, stop = symmetric(omega, size * friction, guess)
            start = release
        system = DryFrictionOscillator(omega=omega, friction=size * friction)
        run = simulate(system, [at, 0.0], start - 0.1, start + half, settings=EXACT)
        leaves = np.asarray(run.switches.kind).tolist().index(2)
        assert float(run.switches.time[leaves]) == pytest.approx(start, abs=1e-9)
        time, state = run.switches.time[leaves + 1], run.switches.after[leaves + 1]
        if kind is None:
            assert float(time) - start == pytest.approx(2 * np.pi, abs=1e-9)
            np.testing.assert_allclose(state, [-at, 0.0], atol=1e-9)
        else:
            assert int(run.switches.kind[leaves + 1]) == kind


def symmetric(omega: float, friction: float, guess) -> tuple[float, float, float]:
    """Where the body stops, and the times of a release from there and of the next stop;
    a guess of the phase and of the duration of the flight is needed.

    From rest at x = A the body is released at the phase p at which the force has
    fallen to A - friction: A = friction + cos p. The flight is V cos(omega t + p) +
    friction + a cos t + b sin t, with a and b from A and the rest; it ends at -A, with
    zero velocity, after a time t: two equations for p and t.
    """
    static, _ = response(omega)

    def mismatch(unknown):
        p, t = unknown
        a, b = np.cos(p) * (1 - static), static * omega * np.sin(p)
        x = static * np.cos(omega * t + p) + friction + a * np.cos(t) + b * np.sin(t)
        slope = -static * omega * np.sin(omega * t + p) - a * np.sin(t) + b * np.cos(t)
        return [x + friction + np.cos(p), slope]

    found = root(mismatch, guess, tol=1e-14)
    assert np.max(np.abs(found.fun)) < 1e-13
    p, t = found.x
    return friction + np.cos(p), p / omega, p / omega + t


def two_stops(omega: float, friction: float) -> tuple[float, float, float]:
    """The motion that begins at the boundary with a flight of half a period; its stops
    grow longer as the friction grows.
    """
    static, lost = response(omega)
    sign = np.sign(static)
    unknown = (np.arctan2(-sign * lost, sign / omega**2), np.pi / omega)
    for rubbing in np.linspace(boundary(omega), friction, 40)[1:]:
        at, release, stop = symmetric(omega, rubbing, unknown)
        unknown = (release * omega, stop - release)
    return at, release, stop


@pytest.mark.parametrize(("omega", "friction"), [(0.7, 0.8), (0.7, 0.9), (1.5, 0.8)])
def test_motion_with_two_stops_a_cycle(omega, friction):
    """Times of both releases and both stops, and the two positions, to 1e-9."""
    at, release, stop = two_stops(omega, friction)
    half = np.pi / omega
    assert 0 < stop - release < half
    system = DryFrictionOscillator(omega=omega, friction=friction)
    orbit = continuation.periodic_orbit(system)
    switches = orbit.switches
    for kind, time, sign in (
        (2, release, 1),
        (1, stop, -1),
        (2, release + half, -1),
        (1, stop + half, 1),
    ):
        is_kind = np.asarray(switches.kind) == kind
        apart = (np.asarray(switches.time)[is_kind] - time + half) % (2 * half) - half
        nearest = int(np.argmin(np.abs(apart)))
        assert apart[nearest] == pytest.approx(0.0, abs=1e-9)
        state = np.asarray(switches.after)[is_kind][nearest]
        np.testing.assert_allclose(state, [sign * at, 0.0], atol=1e-9)
    assert int(switches.count) == 4
