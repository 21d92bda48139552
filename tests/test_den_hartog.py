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
a larger value at t > 0 means that it stops between its turns (grazing-sliding).
"""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar, root

import continuation
from jaxcam.models import DryFrictionOscillator


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


@pytest.mark.parametrize("omega", TURNS[:1] + BETWEEN[:1])
def test_a_branch_locates_den_hartogs_friction(omega):
    """The one special point of the branch, to 1e-9."""
    friction = boundary(omega)
    system = DryFrictionOscillator(omega=omega, friction=0.95 * friction)
    orbit = continuation.periodic_orbit(system)
    bounds = (0.9 * friction, 1.02 * friction)
    found = continuation.branch(system, orbit, "friction", bounds)
    (point,) = found.special
    assert point.converged
    assert point.parameter == pytest.approx(friction, abs=1e-9)


def two_stops(omega: float, friction: float) -> tuple[float, float, float]:
    """Where the body stops, and the times of a release from there and of the next stop.

    From rest at x = A the body is released at the phase p at which the force has
    fallen to A - friction: A = friction + cos p. The flight is V cos(omega t + p) +
    friction + a cos t + b sin t, with a and b from A and the rest; it ends at -A, with
    zero velocity, after a time t: two equations for p and t. Their root is followed
    from the boundary, where the flight takes half a period.
    """
    static, lost = response(omega)

    def mismatch(unknown, rubbing):
        p, t = unknown
        a, b = np.cos(p) * (1 - static), static * omega * np.sin(p)
        x = static * np.cos(omega * t + p) + rubbing + a * np.cos(t) + b * np.sin(t)
        slope = -static * omega * np.sin(omega * t + p) - a * np.sin(t) + b * np.cos(t)
        return [x + rubbing + np.cos(p), slope]

    sign = np.sign(static)
    unknown = np.array([np.arctan2(-sign * lost, sign / omega**2), np.pi / omega])
    for rubbing in np.linspace(boundary(omega), friction, 40)[1:]:
        found = root(mismatch, unknown, args=(rubbing,), tol=1e-14)
        assert np.max(np.abs(found.fun)) < 1e-13
        unknown = found.x
    p, t = unknown
    return friction + np.cos(p), p / omega, p / omega + t


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
