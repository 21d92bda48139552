"""A chart of the cam-follower in its speed and the intercept of its restitution law.

Each curve is compared with something that shares nothing with path following: orbits
with Runge-Kutta runs of SciPy, interruptions with a bracketed search along the speed
alone, detachment with the acceleration that contact suppresses.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import continuation
from jaxcam.hybrid.surface import contact_acceleration
from jaxcam.models import preset, rad_s_to_rpm, rpm_to_rad_s
from jaxcam.parameters import as_arrays
from jaxcam.plotting import special_curves
from variational import chatter_frame


# compiling takes most of the time
pytestmark = pytest.mark.slow

# phase of impact and state after it, of two motions that have settled: with one impact
# a turn at 145 rpm, with six at 152.69 rpm
ONE = np.array([[0.872, 0.3119, 2.4218]])
SIX = np.array(
    [
        [0.43899694, 0.21492647, 0.2608286],
        [0.58197179, 0.2121141, 0.83194103],
        [0.67059632, 0.23437703, 1.10803166],
        [0.73499887, 0.25887811, 1.17317065],
        [0.78806615, 0.28093858, 1.10964948],
        [0.84697404, 0.30366021, 0.91038016],
    ]
)
SPEEDS = rpm_to_rad_s(120.0), rpm_to_rad_s(165.0)
INTERCEPTS = -0.66, -0.58


def speed(system):
    return system.speed


def intercept(system):
    return system.restitution.intercept


def rig(rpm, offset=None):
    system = eqx.tree_at(speed, preset("calibrated"), jnp.asarray(rpm_to_rad_s(rpm)))
    if offset is not None:
        system = eqx.tree_at(intercept, system, jnp.asarray(offset))
    return as_arrays(system)


def impacting(rpm, rows):
    """The orbits that a motion belongs to, and its impacts."""
    problem = continuation.ImpactingOrbits(rig(rpm), (0,) * len(rows), 1, 2)
    return problem, rows.ravel()


def sticking(rpm):
    """The orbit that sticks, and its release."""
    system = rig(rpm)
    frame = chatter_frame(system)
    phase = float(frame.release) / float(system.period)
    return continuation.StickingOrbits(system), np.append(phase, frame.state)


@pytest.fixture(scope="module")
def special():
    """One special point of each kind, at the restitution of the thesis."""
    found = {}
    for problem, start in (impacting(145.0, ONE), sticking(145.0)):
        branch = continuation.branch(problem, start, speed, SPEEDS, direction="both")
        found |= {point.kind: point for point in branch.special}
    plain = continuation.BranchSettings(special=False)
    six = impacting(152.69, SIX)
    for point in continuation.follow(*six, speed, SPEEDS, settings=plain):
        if point.kind == "grazing":
            found["grazing"] = point
            break
    return found


@pytest.fixture(scope="module")
def chart(special):
    """The curves through them."""
    return {
        kind: continuation.curve(point, (speed, intercept), (SPEEDS, INTERCEPTS))
        for kind, point in special.items()
    }


def system_at(point):
    value, offset = point.parameters
    return rig(rad_s_to_rpm(value), offset)


class Flights:
    """Free flight by SciPy."""

    def __init__(self):
        self.rates = jax.jit(lambda system, t, x: system.vector_field(t, x))
        self.gaps = jax.jit(lambda system, t, x: system.gap(t, x))
        self.bounce = jax.jit(lambda system, t, x: system.impact(t, x))

    def fly(self, system, t0, x0, t1, lands=False):
        """Up to `t1`, or to the next impact before it."""

        def gap(t, x):
            return float(self.gaps(system, t, x))

        gap.terminal, gap.direction = lands, -1  # pyright: ignore
        return solve_ivp(
            lambda t, x: np.asarray(self.rates(system, t, x)), (t0, t1), x0,
            method="DOP853", rtol=1e-12, atol=1e-13, events=gap, dense_output=True,
        )  # fmt: skip

    def turn(self, system, state, start):
        """The state one turn after `start` (s), with one impact on the way."""
        end = start + float(system.period)
        first = self.fly(system, start, state, end, lands=True)
        time, before = first.t[-1], first.y[:, -1]
        assert time < end
        after = np.asarray(self.bounce(system, time, before))
        return self.fly(system, time, after, end).y[:, -1]


def test_special_points_at_the_restitution_of_the_thesis(special):
    found = {kind: rad_s_to_rpm(point.parameter) for kind, point in special.items()}
    assert all(point.converged for point in special.values())
    assert abs(found["fold"] - 135.947) < 0.01
    assert 151.8 < found["flip"] < 151.9
    assert abs(found["interruption of chatter"] - 152.67658) < 0.04
    assert abs(found["detachment"] - 125.0) < 0.2


def test_every_curve_crosses_the_chart(chart):
    assert len(chart) == 5
    for curve in chart.values():
        ends = [curve.points[k].parameters[1] for k in (0, -1)]
        assert ends == list(INTERCEPTS)
        assert not curve.special


@pytest.mark.parametrize("kind, critical", [("fold", 1.0), ("flip", -1.0)])
def test_folds_and_flips_have_their_multiplier_in_another_integrator(
    chart, kind, critical
):
    flights = Flights()
    points = chart[kind].points
    for point in (points[0], points[len(points) // 2], points[-1]):
        system = system_at(point)
        # half a turn away from the impact
        start = (float(point.state[0]) - 0.5) * float(system.period)
        flight = flights.fly(
            system, start + 0.5 * float(system.period), point.state[1:3],
            start + float(system.period),
        )  # fmt: skip
        state = flight.y[:, -1]
        np.testing.assert_allclose(flights.turn(system, state, start), state, atol=1e-9)
        h, columns = 1e-5, []
        for one in np.eye(2):
            ahead = flights.turn(system, state + h * one, start)
            back = flights.turn(system, state - h * one, start)
            columns.append((ahead - back) / (2 * h))
        matrix = np.stack(columns, axis=1)
        r = float(system.restitution(system.speed, jnp.asarray(0.0)))
        # flight is conservative, so the other multiplier is r^2 over the critical one
        assert np.linalg.det(matrix) == pytest.approx(r * r, abs=1e-6)
        assert np.trace(matrix) == pytest.approx(critical * (1 + r * r), abs=1e-5)


def test_grazing_orbits_touch_the_cam_in_another_integrator(chart):
    flights = Flights()
    points = chart["grazing"].points
    for point in (points[0], points[len(points) // 2], points[-1]):
        system = system_at(point)
        period = float(system.period)
        rows = point.state[:-1].reshape(-1, 3)
        ends = np.concatenate([rows[1:], rows[:1] + [[1.0, 0.0, 0.0]]])
        jumps = []
        for row, end in zip(rows, ends, strict=True):
            run = flights.fly(system, row[0] * period, row[1:], end[0] * period)
            time, before = run.t[-1], run.y[:, -1]
            assert abs(float(flights.gaps(system, time, before))) < 1e-9
            after = np.asarray(flights.bounce(system, time, before))
            np.testing.assert_allclose(after, end[1:], atol=1e-8)
            jumps.append(abs(after[1] - before[1]))
        # one of the six impacts changes nothing, and only one
        one, other = np.sort(jumps)[:2]
        assert one < 1e-8 and other > 1e-2


def test_interruptions_are_those_of_a_search_along_the_speed(chart):
    for point in chart["interruption of chatter"].points[::4]:
        value, offset = point.parameters
        near = (value - 0.01, value + 0.01)
        direct = continuation.chatter_interruption(rig(150.0, offset), speed, near)
        assert abs(float(direct) - value) < 1e-9


def test_impacts_begin_where_contact_stops_pulling(chart):
    curve = chart["detachment"]
    # the law of impacts plays no part in it
    assert np.ptp([point.parameters[0] for point in curve.points]) < 1e-10
    system = system_at(curve.points[0])
    phase, width = 0.5, 1.0
    for _ in range(3):
        phases = phase + width * np.linspace(-0.5, 0.5, 2001)
        times = jnp.asarray(phases * float(system.period))
        values = contact_acceleration(system, times, jnp.zeros(2))
        phase, width = phases[int(jnp.argmax(values))], 2e-3 * width
    scale = float(jnp.max(jnp.abs(contact_acceleration(system, times, jnp.zeros(2)))))
    assert abs(float(jnp.max(values))) < 1e-8 * max(scale, 1.0)


def test_chart_is_drawn(chart):
    figure = special_curves(
        chart.values(),
        x_label=("speed", "rpm"),
        y_label=("intercept of restitution", "-"),
        x_scale=30 / np.pi,
    )
    (ax,) = figure.axes
    assert len(ax.lines) == len(chart)
    assert ax.get_ylim() == INTERCEPTS
    plt.close(figure)


def test_a_branch_is_no_chart(special):
    branch = continuation.Branch((special["fold"],), "speed", SPEEDS, 0, ("speed",))
    with pytest.raises(ValueError, match="two parameters"):
        special_curves(branch)
