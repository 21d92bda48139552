"""Recordings cut at the gaps of a model: two bodies that hit a wall and each other."""

import dataclasses
import functools
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcam.fitting import (
    Model,
    Parameter,
    Problem,
    segment_by_model,
    Sensor,
    Turning,
)
from jaxcam.recordings import Recording, RecordingError
from jaxcam.recordings.cut import segment_gaps
from jaxcam.recordings.cut._cut import _impact


RIGS = Path(__file__).parents[1] / "docs" / "rigs"
NOISE, INTERVAL, SPEED = 4e-6, 5e-4, 44.0


def rig(name: str):
    """A file of `docs/rigs`, as a module."""
    spec = importlib.util.spec_from_file_location(name, RIGS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TwoMasses = rig("two_masses").TwoMasses
WALL_OFF = 1.5e-4


@functools.cache
def recorded():
    """One second of both masses by DOP853, flight by flight, and the true impacts."""
    s = TwoMasses()

    def field(t, y):
        shaken = s.shaker_amplitude * np.sin(SPEED * t)
        return [
            y[1],
            -s.k1_over_m1 * (y[0] - s.rest1) - s.c1_over_m1 * y[1],
            y[3],
            -s.k2_over_m2 * (y[2] - s.rest2 - shaken) - s.c2_over_m2 * y[3],
        ]

    events = [lambda t, y: y[0] - WALL_OFF, lambda t, y: y[2] - y[0]]
    for event in events:
        event.terminal, event.direction = True, -1  # pyright: ignore
    time = INTERVAL * np.arange(2000)
    states, hits = np.zeros((len(time), 4)), []
    t, y = 0.0, np.array([0.004, 0.0, 0.012, 0.0])
    while t < time[-1]:
        part = solve_ivp(
            field,
            (t, time[-1]),
            y,
            "DOP853",
            events=events,
            dense_output=True,
            rtol=1e-10,
            atol=1e-13,
        )
        inside = (time >= t) & (time <= part.t[-1])
        states[inside] = part.sol(time[inside]).T  # pyright: ignore
        t, y = part.t[-1], part.y[:, -1]
        if part.status == 1:
            side = int(len(part.t_events[1]) > 0)  # pyright: ignore
            hits.append((t, side))
            x1, v1, x2, v2 = y
            if side == 0:
                v1 = -s.restitution_wall * v1
            else:
                kick = (1 + s.restitution_masses) * (v1 - v2) / (1 + s.mass_ratio)
                v1, v2 = v1 - s.mass_ratio * kick, v2 + kick
            y = np.array([x1, v1, x2, v2])
    rng = np.random.default_rng(3)
    seen = states[:, [0, 2]] + NOISE * rng.standard_normal((len(time), 2))
    channels = {
        "position1_m": seen[:, 0],
        "position2_m": seen[:, 1],
        "drive_angle_rad": SPEED * time + 1e-4 * rng.standard_normal(len(time)),
    }
    return Recording("run", time, channels), np.array(hits)


def _speed(system):
    return system.speed


def _phase(system):
    return system.phase


def _rest(found):
    return found.system.rest1


def model(channels=(("position1_m", 0), ("position2_m", 2))):
    sensors = {name: Sensor(place, noise=NOISE) for name, place in channels}
    return Model(TwoMasses(), sensors, Turning(_speed, _phase))


REST = Parameter("rest1", _rest, tolerance=2e-4)


def test_each_impact_is_on_the_gap_that_closed():
    """Times within 0.05 ms and restitutions within 0.03, though gaps close in turn.

    Over 0.1 s, most of a period, no cubic follows these flights.
    """
    recording, hits = recorded()
    (found,) = segment_by_model(
        model(), [recording], [REST], drive_channel="drive_angle_rad"
    )
    assert found.drive is not None
    assert found.drive.speed == pytest.approx(SPEED, rel=1e-4)
    inside = hits[hits[:, 0] < 0.98]
    assert len(inside) > 15 and set(inside[:, 1]) == {0, 1}
    laws = np.array([TwoMasses().restitution_wall, TwoMasses().restitution_masses])
    for time, side in inside:
        k = int(np.argmin(np.abs(found.impacts.time - time)))
        assert abs(found.impacts.time[k] - time) < 5e-5
        assert found.impacts.side[k] == side
        assert found.impacts.restitution[k] == pytest.approx(laws[int(side)], abs=0.03)
    assert np.all(found.impacts.approach > 0)


def test_flights_of_all_channels_end_where_any_gap_closes():
    recording, hits = recorded()
    (found,) = segment_by_model(model(), [recording], drive_channel="drive_angle_rad")
    starts = [flight.start.time for flight in found.flights]
    late = [np.min(np.abs(hits[:, 0] - time)) for time in starts[1:]]
    assert np.max(late) < INTERVAL / 2


def test_a_gap_that_no_channel_shows_is_refused():
    recording, _ = recorded()
    with pytest.raises(RecordingError, match=r"gap 2 \(other mass\) depends on `x2`"):
        segment_by_model(model((("position1_m", 0),)), [recording])


def test_times_in_milliseconds_read_as_seconds_are_refused():
    """A fit would search for minutes: the model oscillates many times per sample."""
    recording, _ = recorded()
    slow = dataclasses.replace(recording, time=1e3 * recording.time)
    with pytest.raises(RecordingError, match="check the unit of the time column"):
        segment_by_model(model(), [slow])


def test_without_a_gap_the_record_is_one_flight():
    Stage = rig("stage").Stage
    recording, _ = recorded()
    still = Model(Stage(), {"position1_m": Sensor(0, noise=NOISE)})
    (found,) = segment_by_model(still, [recording])
    assert len(found.flights) == 1 and found.impacts.count == 0


def test_what_is_not_told_by_contact_is_not_asked():
    """Of two bodies, stretches at rest are no data; flights of both channels are."""
    recording, _ = recorded()
    parts = segment_by_model(model(), [recording], drive_channel="drive_angle_rad")
    problem = Problem.build(model(), parts, [REST])
    assert not np.any(np.asarray(problem.pieces.rest_exists))
    assert problem.samples > 1.5 * len(recording)


@pytest.mark.parametrize(
    ("separation", "kind"),
    [(0.3, "impact"), (-0.02, "impact"), (-0.2, "several impacts")],
)
def test_a_jump_that_leads_on_into_the_surface_is_more_than_one(separation, kind):
    """Three standard errors (0.01) below zero no single impact has a separation."""
    found = {
        "time": 1.0,
        "time_stderr": 1e-5,
        "before": -0.5,
        "before_stderr": 0.01,
        "after": separation,
        "after_stderr": 0.01,
        "separation": separation,
    }
    assert _impact(found).kind == kind


def _bounces(top: float, time) -> np.ndarray:
    """The gap (m) of a body that lands at 0.2 s and stays in contact until `top`."""
    gap = np.where(time < 0.2, np.sin(12 * (0.2 - time)), 0.0)
    gap = np.where(time > top, 8 * (time - top) ** 2, gap)
    return gap + 1e-4 * np.random.default_rng(0).standard_normal(len(time))


def test_two_bodies_may_be_in_contact_at_the_same_time():
    """Their contacts, until 0.4 s and 0.5 s, count as one, which ends like the longer
    of the two alone (to 5 ms), and begins at 0.2 s (to 1 ms).
    """
    time = 1e-3 * np.arange(800)

    def contact(*tops):
        gaps = np.stack([_bounces(top, time) for top in tops])
        run = Recording("two", time, {"gap_m": gaps[0]})
        (found,) = segment_gaps(run, "gap_m", gaps, [0.0] * len(tops)).contacts
        return found

    alone = contact(0.5).stop
    for tops in ((0.4, 0.5), (0.5, 0.4), (0.5, 0.5)):
        both = contact(*tops)
        assert abs(both.start.time - 0.2) < 1e-3
        assert both.stop.kind == alone.kind == "release"
        assert abs(both.stop.time - alone.time) < 5e-3


@pytest.mark.parametrize(
    ("lower", "upper", "scale"),
    [(0.35, -0.42, 1.0), (-0.35, 0.42, 180 / np.pi)],
    ids=["walls exchanged", "degrees called radians"],
)
def test_a_motion_inside_its_walls_is_refused(lower, upper, scale):
    """More than half of the samples are inside, by more than a quarter of the range."""
    time = 2e-3 * np.arange(500)
    swing = (2 / np.pi) * np.arcsin(np.sin(9 * time))
    angle = scale * (0.035 + 0.385 * swing)
    angle = angle + 1e-4 * np.random.default_rng(0).standard_normal(len(time))
    run = Recording("run1", time, {"angle_rad": angle})
    gaps = np.stack([angle - lower, upper - angle])
    with pytest.raises(RecordingError, match="run1: the motion is inside .*gap 1 and"):
        segment_gaps(run, "angle_rad", gaps, [0.01, 0.01])
