"""Segmentation with a measured velocity: bounces of a ball in closed form."""

import numpy as np
import pytest

from jaxcam.fitting import Model, segment_by_model, Sensor
from jaxcam.models import BouncingBall
from jaxcam.recordings import Recording
from jaxcam.recordings.cut import segment_gaps


GRAVITY, HEIGHT, INTERVAL = 9.81, 0.5, 2e-3
# 4 % of the height, and 4 % of the largest speed
NOISE, SPEED_NOISE = 0.02, 0.12


def bounced(restitution: float, duration: float):
    """Times of the impacts, and time, height and velocity of a ball dropped from
    0.5 m, which stays on the floor when its rebounds are over."""
    time = INTERVAL * np.arange(round(duration / INTERVAL))
    height, velocity = np.zeros((2, len(time)))
    hits, start, y, v = [], 0.0, HEIGHT, 0.0
    while start < duration and (not hits or v > 1e-3):
        fall = (v + np.sqrt(v**2 + 2 * GRAVITY * y)) / GRAVITY
        s = time - start
        inside = (s >= 0) & (s < fall)
        height[inside] = (y + v * s - GRAVITY * s**2 / 2)[inside]
        velocity[inside] = (v - GRAVITY * s)[inside]
        y, v, start = 0.0, restitution * (GRAVITY * fall - v), start + fall
        hits.append(start)
    rng = np.random.default_rng(5)
    height += NOISE * rng.standard_normal(len(time))
    velocity += SPEED_NOISE * rng.standard_normal(len(time))
    return np.array(hits), Recording(
        "ball", time, {"height_m": height, "velocity_m_s": velocity}
    )


def test_a_measured_rate_shows_impacts_and_rest():
    """With an offset of 5 standard deviations of the sensor, each of the impacts
    faster than 0.9 m/s is found within 2 ms, its speeds within 0.3 m/s, no other
    impact is found, and contacts begin only after the fourth impact, above which
    the ball rises by less than half a standard deviation."""
    hits, run = bounced(0.6, 2.0)
    rate = run["velocity_m_s"] + 5 * SPEED_NOISE
    height = run["height_m"]
    found = segment_gaps(run, "height_m", height[None], [0.0], rates=[rate])
    speeds = np.sqrt(2 * GRAVITY * HEIGHT) * 0.6 ** np.arange(len(hits))
    fast = speeds > 0.9
    assert np.sum(fast) == 3
    impacts = found.impacts
    assert impacts.time[:3] == pytest.approx(hits[:3], abs=INTERVAL)
    assert impacts.approach[:3] == pytest.approx(speeds[:3], abs=0.3)
    assert impacts.separation[:3] == pytest.approx(0.6 * speeds[:3], abs=0.3)
    assert np.all(np.min(np.abs(impacts.time[:, None] - hits), axis=1) < 5 * INTERVAL)
    assert all(contact.start.time > hits[3] for contact in found.contacts)
    assert hits[4] - 0.02 < found.contacts[-1].start.time < hits[-1]
    assert found.contacts[-1].stop.time == pytest.approx(run.time[-1])


def test_a_body_that_turns_round_near_a_surface_is_not_in_contact():
    """The ball turns round 1 and 3.5 standard deviations below a ceiling; the floor is
    hit seven times in 4 s, and there is no contact."""
    hits, run = bounced(0.95, 4.0)
    hits = hits[hits < 4.0]
    height, rate = run["height_m"], run["velocity_m_s"]
    gaps = np.stack([height, 0.52 - height])
    found = segment_gaps(run, "height_m", gaps, [0.0, 0.0], rates=[rate, -rate])
    assert found.impacts.time == pytest.approx(hits, abs=INTERVAL)
    assert not np.any(found.impacts.side)
    assert found.contacts == ()


def test_the_rate_of_a_gap_is_computed_from_the_channels_of_a_model():
    """With the velocity among the sensors, all impacts on a vibrating floor are found;
    the height alone shows fewer."""
    hits, run = bounced(0.95, 2.0)
    hits = hits[hits < 2.0]
    # the floor and the ball on it move by 3 noises at 2 rad/s
    ball = BouncingBall(amplitude=3 * NOISE, frequency=2.0)
    floor = 3 * NOISE * np.sin(2.0 * run.time)
    channels = {
        "height_m": run["height_m"] + floor,
        "velocity_m_s": run["velocity_m_s"] + 6 * NOISE * np.cos(2.0 * run.time),
    }
    moved = Recording("ball", run.time, channels)
    sensors = {
        "height_m": Sensor(0, noise=NOISE),
        "velocity_m_s": Sensor(1, noise=SPEED_NOISE),
    }
    (both,) = segment_by_model(Model(ball, sensors), [moved])
    assert both.impacts.time == pytest.approx(hits, abs=INTERVAL)
    (alone,) = segment_by_model(Model(ball, {"height_m": sensors["height_m"]}), [moved])
    assert alone.impacts.count < len(hits)
    # the slopes of a saturated velocity say nothing about an impact
    limited = np.clip(channels["velocity_m_s"], -1.0, 1.0)
    (cut,) = segment_by_model(
        Model(ball, sensors),
        [Recording("ball", run.time, channels | {"velocity_m_s": limited})],
    )
    assert np.array_equal(cut.impacts.time, alone.impacts.time)
