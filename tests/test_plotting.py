"""Figures draw without a warning and show what the trajectory has."""

import matplotlib
import numpy as np
import pytest


matplotlib.use("Agg")

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
from matplotlib.colors import to_rgba

from jaxcam import plotting, simulate
from jaxcam.cli._trajectory import summary
from jaxcam.hybrid import HybridSystem, Settings, Trajectory
from jaxcam.hybrid.record import Contacts, Impacts, Steps, Switches
from jaxcam.models import BouncingBall
from jaxcam.plotting.curves import trajectory_curve
from jaxcam.recordings import Recording
from jaxcam.recordings.against_model import Comparison, Residuals
from jaxcam.tables import scaled


pytestmark = pytest.mark.filterwarnings("error")

RESTITUTION, GRAVITY = 0.5, 10.0


class ClosedForm(Trajectory):
    """Parabolas between impacts, then rest: a trajectory that needs no solver."""

    def at(self, times):
        hits = np.concatenate([[0.0], np.asarray(self.impacts.time)])
        starts = np.concatenate([self.steps.state[:1], self.impacts.after])
        times = np.asarray(times)
        last = np.searchsorted(hits, times, side="right") - 1
        t, (x, v) = times - hits[last], starts[last].T
        g = float(getattr(self.system, "gravity", 0.0))
        state = np.stack([x + v * t - g * t**2 / 2, v - g * t], axis=1)
        rests = np.any(
            (times[:, None] >= self.contacts.start)
            & (times[:, None] <= self.contacts.end),
            axis=1,
        )
        return np.where(rests[:, None], 0.0, state)

    def gap(self, times):
        height = self.at(times)[:, 0]
        if isinstance(self.system, BouncingBall):
            return height
        return np.stack([height, 1 - height], axis=1)


class TwoWalls(HybridSystem):
    """A particle between two walls, without units or a forcing."""

    constraint_names = ("left wall", "right wall")

    def vector_field(self, t, state):
        return jnp.stack([state[1], 0.0 * state[0]])

    def gap(self, t, state):
        return jnp.stack([state[0], 1 - state[0]])

    def impact(self, t, state):
        bounced = jnp.stack([state[0], -state[1]])
        return jnp.stack([bounced, bounced])


def closed_form(system, t1, start, time, before, after, constraint, rest=None):
    k = len(time)
    impacts = Impacts(
        np.asarray(time),
        np.asarray(before).reshape(k, 2),
        np.asarray(after).reshape(k, 2),
        np.asarray(constraint, dtype=int),
        -np.abs(np.asarray(before).reshape(k, 2)[:, 1]),
        np.abs(np.asarray(after).reshape(k, 2)[:, 1]),
        np.asarray(k),
    )
    spans = np.zeros((0, 2)) if rest is None else np.array([[rest, t1]])
    none = np.zeros(len(spans), dtype=int)
    contacts = Contacts(
        spans[:, 0], spans[:, 1], none.astype(bool), none, np.asarray(len(spans))
    )
    ends = np.array([0.0, t1])
    states = np.array([start, start], dtype=float)
    steps = Steps(ends, states, np.zeros((2, 1), dtype=bool), np.asarray(2))
    return ClosedForm(
        system,
        Settings(),
        np.asarray(0.0),
        np.asarray(t1),
        impacts,
        contacts,
        steps,
        np.asarray(0),
    )


@pytest.fixture
def ball():
    """Dropped from 0.2 m: impacts at 0.2 s and then after flights of 0.2 / 2^k s."""
    number, t1 = 30, 0.8
    flights = 0.2 * RESTITUTION ** np.arange(number - 1)
    time = 0.2 + np.concatenate([[0.0], np.cumsum(flights)])
    speed = 2.0 * RESTITUTION ** np.arange(number)
    none = np.zeros(number)
    system = BouncingBall(
        gravity=GRAVITY, restitution=RESTITUTION, frequency=2 * np.pi / 0.25
    )
    before, after = np.stack([none, -speed], 1), np.stack([none, speed / 2], 1)
    constraint = np.zeros(number, dtype=int)
    return closed_form(system, t1, [0.2, 0.0], time, before, after, constraint, 0.6)


@pytest.fixture
def walls():
    """From the left wall at unit speed: a wall is hit every second."""
    time = np.arange(1.0, 6.0)
    right = np.arange(5) % 2 == 0
    speed = np.where(right, 1.0, -1.0)
    before, after = np.stack([right, speed], 1), np.stack([right, -speed], 1)
    return closed_form(TwoWalls(), 5.5, [0.0, 1.0], time, before, after, right)


@pytest.fixture
def recording():
    time = np.arange(4000) / 2000
    turned = 15.0 * time + 0.3
    channels = {
        "cam_angle_rad": turned,
        "follower_angle_rad": 0.27 + 0.06 * np.cos(turned),
    }
    return Recording("run1", time, channels)


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


def line(ax, label):
    (found,) = [each for each in ax.lines if each.get_label() == label]
    return found


def has_unit(label):
    return label.rstrip().endswith(")") and "(" in label


def test_time_history_marks_every_impact_and_contact(ball):
    figure = plotting.time_history(ball)
    figure.canvas.draw()
    height, velocity, gap = figure.axes
    for ax in (height, velocity, gap):
        assert len(line(ax, "impact").get_xdata()) == 30
        assert len(ax.patches) == 1
    assert height.get_ylabel() == "height\n(m)"
    assert velocity.get_ylabel() == "velocity\n(m/s)"
    assert gap.get_ylabel() == "gap\n(m)"
    assert gap.get_xlabel() == "time (s)"
    np.testing.assert_array_equal(line(gap, "impact").get_ydata(), 0.0)


def test_time_history_of_a_part_and_of_one_component(ball):
    figure = plotting.time_history(ball, components=[1], between=(0.3, 0.58))
    velocity, gap = figure.axes
    inside = np.sum((ball.impacts.time >= 0.3) & (ball.impacts.time <= 0.58))
    assert 0 < inside < 30
    assert len(line(velocity, "impact").get_xdata()) == inside
    assert not velocity.patches and not gap.patches


def test_time_history_of_several_constraints(walls):
    figure = plotting.time_history(walls)
    figure.canvas.draw()
    first, second, gap = figure.axes
    assert "x_{1}" in first.get_ylabel() and has_unit(second.get_ylabel())
    assert line(gap, "left wall") and line(gap, "right wall")


def test_a_curve_ends_in_the_state_before_an_impact(ball):
    drawn = trajectory_curve(ball)
    ends = np.flatnonzero(np.isnan(drawn.time)) - 1
    first = ends[0]
    assert drawn.time[first] == pytest.approx(0.2, abs=1e-15)
    np.testing.assert_allclose(drawn.state[first], [0.0, -2.0], atol=1e-15)
    np.testing.assert_allclose(drawn.state[first + 2], [0.0, 1.0], atol=1e-15)
    # every flight is drawn, however short: one before each impact, the one that the
    # accumulation of the impacts ends, and the contact
    assert len(ends) == 30 + 1 + 1
    assert np.nanmin(drawn.gap) >= -1e-12
    assert drawn.contact[-1] and not drawn.contact[first]


def test_a_curve_is_dense_between_switches(ball):
    """At least 40 points between two events, and the switches themselves, even if the
    number of samples is small; the sentence of `jaxcam simulate` counts the switches.
    """
    time, none = np.array([0.05, 0.15]), np.zeros(2)
    states = np.zeros((2, 2))
    kind = surface = none.astype(int)
    switches = Switches(time, states, states, surface, none, np.asarray(2), kind)
    switched = eqx.tree_at(
        lambda one: one.switches, ball, switches, is_leaf=lambda one: one is None
    )
    drawn = trajectory_curve(switched, (0.0, 0.2), 10)
    assert set(time) <= set(drawn.time)
    bounds = [0.0, *time, 0.2]
    for low, high in zip(bounds, bounds[1:]):
        assert np.sum((low <= drawn.time) & (drawn.time <= high)) >= 40
    # a switch does not break the line
    assert np.sum(np.isnan(drawn.time)) == 1
    assert "30 impacts, 1 contact, 2 switching events" in summary("ball", switched)


def test_phase_portrait_has_jumps_and_stroboscopic_points(ball):
    figure = plotting.phase_portrait(ball)
    figure.canvas.draw()
    (ax,) = figure.axes
    assert line(ax, "impact").get_linestyle() == "--"
    jumps = line(ax, "impact").get_ydata()
    assert np.sum(np.isnan(jumps)) == 30
    # the ball rests in one point, which is marked
    (rest,) = [each for each in ax.lines if each.get_marker() == "s"]
    np.testing.assert_array_equal(rest.get_xydata(), [[0.0, 0.0]])
    # 0, 0.25, 0.5 and 0.75 s
    assert len(line(ax, "stroboscopic points").get_xdata()) == 4
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("height (m)", "velocity (m/s)")


def test_phase_portrait_turns_round_and_takes_axes(ball, walls):
    own, ax = plt.subplots()
    figure = plotting.phase_portrait(ball, ax, components=(1, 0), period=0.1)
    assert figure is own
    assert ax.get_xlabel() == "velocity (m/s)"
    assert len(line(ax, "stroboscopic points").get_xdata()) == 9
    # no forcing, no points
    (ax,) = plotting.phase_portrait(walls).axes
    labels = [each.get_label() for each in ax.lines]
    assert "stroboscopic points" not in labels


def test_impact_map_has_a_point_for_every_pair(ball):
    figure = plotting.impact_return_map(ball)
    figure.canvas.draw()
    phase, speed = figure.axes
    points = line(speed, "constraint 0")
    assert len(points.get_xdata()) == 29
    np.testing.assert_allclose(points.get_ydata(), RESTITUTION * points.get_xdata())
    assert speed.get_xscale() == "log"
    assert np.all(line(phase, "constraint 0").get_xdata() <= 2 * np.pi)
    assert phase.get_ylabel() == "phase of impact $k+1$ (rad)"
    assert speed.get_xlabel() == "speed of impact $k$ (m/s)"


@pytest.mark.usefixtures("unchecked_types")
def test_impact_map_against_time_and_without_a_period(ball, walls):
    left, _ = plotting.impact_return_map(ball, against="time").axes
    assert left.get_xlabel() == "time of impact $k$ (s)"
    left, right = plotting.impact_return_map(walls).axes
    assert left.get_xlabel().startswith("time of impact")
    first, second = line(right, "left wall"), line(right, "right wall")
    assert len(first.get_xdata()) == 2 and len(second.get_xdata()) == 2
    with pytest.raises(ValueError, match='choose "phase" or "time"'):
        plotting.impact_return_map(ball, against="speed")


def test_figures_of_a_simulated_trajectory(ball):
    simulated = simulate(ball.system, jnp.array([0.2, 0.0]), 0.0, 0.8)
    height, _, gap = plotting.time_history(simulated).axes
    number = int(simulated.impacts.count)
    assert number > 10
    assert len(line(gap, "impact").get_xdata()) == number
    assert len(height.patches) == 1
    drawn = trajectory_curve(simulated)
    flying = ~np.isnan(drawn.time) & (drawn.time < 0.55)
    np.testing.assert_allclose(
        drawn.gap[flying, 0], ball.gap(drawn.time[flying]), atol=1e-9
    )
    (ax,) = plotting.phase_portrait(simulated).axes
    assert len(line(ax, "stroboscopic points").get_xdata()) == 4
    _, speed = plotting.impact_return_map(simulated).axes
    assert len(line(speed, "constraint 0").get_xdata()) == number - 1


def test_figures_of_a_flight_without_impacts(ball):
    alone = (0.0, 0.1)
    for figure in (
        plotting.time_history(ball, between=alone),
        plotting.phase_portrait(ball, between=alone),
        plotting.impact_return_map(ball, between=alone),
    ):
        figure.canvas.draw()


def test_wrong_axes_and_wrong_span_say_what_to_do(ball):
    _, two = plt.subplots(2)
    with pytest.raises(ValueError, match="has 3 panels"):
        plotting.time_history(ball, two)
    with pytest.raises(ValueError, match="covers 0 to 0.8 s"):
        plotting.time_history(ball, between=(0.5, 1.0))


def test_own_axes_are_used(ball):
    own, axes = plt.subplots(3, 1)
    assert plotting.time_history(ball, axes) is own
    own, axes = plt.subplots(1, 2)
    assert plotting.impact_return_map(ball, axes) is own


def test_compare_recording_in_turns_of_the_cam(recording):
    simulated = recording["follower_angle_rad"] + 3e-4
    figure = plotting.compare_recording(
        recording, simulated, contact=simulated - 0.01, noise=1e-4, turns=2
    )
    figure.canvas.draw()
    above, below = figure.axes
    turns = line(above, "recorded").get_xdata()
    assert np.ptp(turns) == pytest.approx(2, abs=0.01)
    assert 0 <= turns[0] < 1
    assert above.get_ylabel() == "follower angle (rad)"
    assert below.get_ylabel() == "residual (mrad)"
    assert below.get_xlabel() == "cam (turns)"
    residual = below.lines[0].get_ydata()
    np.testing.assert_allclose(residual, -0.3)


def test_compare_recording_with_several_simulations_and_without_a_cam(recording):
    fall = Recording("drop", recording.time, {"height_m": recording.time})
    runs = {"textbook": fall.time + 1.0, "with drag": fall.time}
    figure = plotting.compare_recording(fall, runs, channel="height_m", start=1.0)
    above, below = figure.axes
    assert line(above, "simulated textbook") and line(above, "simulated with drag")
    assert above.get_ylabel() == "height (m)"
    assert below.get_xlabel() == "time (s)"
    assert line(above, "recorded").get_xdata()[0] == 1.0
    with pytest.raises(ValueError, match="sample them at `recording.time`"):
        plotting.compare_recording(fall, np.zeros(3), channel="height_m")


@pytest.mark.parametrize(
    "unit, largest, expected",
    [
        ("rad", 3e-4, (1e3, "mrad")),
        ("rad/s", 3e-6, (1e6, "µrad/s")),
        ("m", 0.3, (1.0, "m")),
        ("-", 1e-4, (1.0, "-")),
        ("rad", 0.0, (1.0, "rad")),
    ],
)
def test_prefixes_suit_the_size(unit, largest, expected):
    assert scaled(unit, largest) == expected


def test_the_style_leaves_the_reader_settings_alone(ball, tmp_path):
    before = dict(matplotlib.rcParams)
    figure = plotting.time_history(ball)
    written = plotting.save_figure(figure, tmp_path / "new" / "history.png")
    assert written.stat().st_size > 10_000
    assert dict(matplotlib.rcParams) == before
    assert not plt.get_fignums()
    with plotting.style():
        cycle = plt.rcParams["axes.prop_cycle"].by_key()["color"]
    assert to_rgba(cycle[0]) == to_rgba("#0072B2")
    assert len(set(cycle)) == 7


def residuals(record, mode, channel, unit, size, number=200, turned=True):
    rng = np.random.default_rng(number)
    time = np.linspace(0.0, 2.0, number)
    return Residuals(
        record,
        mode,
        channel,
        unit,
        time,
        15.0 * time if turned else np.full(number, np.nan),
        size * rng.standard_normal(number),
        np.full(number, size),
        np.arange(number) // 20,
    )


@pytest.fixture
def comparison():
    angle = "follower_angle_rad"
    return Comparison(
        (
            residuals("run1", "flight", angle, "rad", 9e-5),
            residuals("run1", "impact speed", angle, "rad/s", 0.03, 12),
            residuals("run2", "flight", angle, "rad", 9e-5, 300),
        )
    )


def test_residual_by_mode_has_a_row_for_every_mode(comparison):
    figure = plotting.residual_by_mode(comparison)
    figure.canvas.draw()
    flight, flight_shares, impact, shares = figure.axes
    assert flight.get_title(loc="left").startswith("flight, follower angle: ")
    assert "rms, noise" in impact.get_title(loc="left")
    assert flight.get_ylabel() == "residual (mrad)"
    assert impact.get_ylabel() == "residual (rad/s)"
    assert impact.get_xlabel() == "time (s)"
    assert shares.get_xlabel() == "fraction (%)"
    assert len(line(flight, "run1").get_xdata()) == 200
    assert len(line(flight, "run2").get_xdata()) == 300
    # the bars are all of the samples, and agree with what noise alone would give
    bars = [bar.get_width() for bar in flight_shares.containers[0]]
    assert sum(bars) == pytest.approx(100)
    (expected,) = [p for p in flight_shares.patches if hasattr(p, "get_data")]
    np.testing.assert_allclose(bars, expected.get_data().values, atol=4.0)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["run1", "run2"]


def test_residual_by_mode_of_one_record_and_against_phase(comparison):
    figure = plotting.residual_by_mode(comparison, record="run1", against="phase")
    figure.canvas.draw()
    flight = figure.axes[0]
    assert not figure.legends
    assert np.max(line(flight, "run1").get_xdata()) < 2 * np.pi
    assert figure.axes[2].get_xlabel() == "cam angle within one turn (rad)"


@pytest.mark.usefixtures("unchecked_types")
def test_residual_by_mode_says_what_is_missing(comparison):
    with pytest.raises(ValueError, match="has run1, run2"):
        plotting.residual_by_mode(comparison, record="run9")
    with pytest.raises(ValueError, match='choose "time" or "phase"'):
        plotting.residual_by_mode(comparison, against="angle")
    fall = Comparison(
        (residuals("drop", "flight", "height_m", "m", 0.1, turned=False),)
    )
    with pytest.raises(ValueError, match='choose against="time"'):
        plotting.residual_by_mode(fall, against="phase")


def test_compare_recording_takes_a_comparison(recording):
    angle = recording["follower_angle_rad"]
    rows = np.arange(100, 300)
    part = Residuals(
        "run1",
        "flight",
        "follower_angle_rad",
        "rad",
        recording.time[rows],
        recording["cam_angle_rad"][rows],
        np.full(200, 2e-4),
        np.full(200, 1e-4),
        np.zeros(200, dtype=int),
    )
    figure = plotting.compare_recording(recording, Comparison((part,)))
    above, below = figure.axes
    drawn = line(above, "simulated").get_ydata()
    assert np.sum(np.isfinite(drawn)) == 200
    np.testing.assert_allclose(drawn[rows], angle[rows] - 2e-4)
    np.testing.assert_allclose(below.lines[0].get_ydata()[rows], 0.2)
    with pytest.raises(ValueError, match="it has follower_angle_rad of run1"):
        plotting.compare_recording(recording, Comparison((part,)), channel="gyro_rad_s")


def test_a_figure_is_recoloured_for_a_dark_page(ball):
    figure = plotting.time_history(ball)
    height = figure.axes[0]
    curve = line(height, "state")
    before = curve.get_color()
    assert plotting.on_dark(figure) is figure
    background, text = figure.get_facecolor(), height.yaxis.label.get_color()
    assert max(background[:3]) < 0.2 < 0.8 < min(to_rgba(text)[:3])
    # the same hue, lighter
    light = np.subtract(to_rgba(curve.get_color()), to_rgba(before))[:3]
    assert np.all(light > 0) and np.argmax(to_rgba(curve.get_color())[:3]) == 2
    (tick, *_) = height.get_yticklabels()
    assert min(to_rgba(tick.get_color())[:3]) > 0.8
    figure.canvas.draw()
