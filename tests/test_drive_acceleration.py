"""The angular acceleration of a drive, estimated from its encoder."""

import math

import numpy as np
import pytest

from jaxcam.recordings import Recording
from jaxcam.recordings.cut import read_drive


INTERVAL, NOISE = 5e-4, 1e-4


def _drive(wander: float, hertz: float, rng, speed=12.0, duration=6.0):
    """A drive whose rate wanders by a share of its speed; its true acceleration."""
    time = INTERVAL * np.arange(round(duration / INTERVAL))
    w = 2 * math.pi * hertz
    lead = rng.uniform(0, 2 * math.pi)
    angle = speed * (time + wander * np.sin(w * time + lead) / w)
    true = -speed * wander * w * np.sin(w * time + lead)
    noisy = angle + NOISE * rng.standard_normal(len(time))
    return read_drive(Recording("run", time, {"cam_angle_rad": noisy})), true


@pytest.mark.parametrize(
    "wander, hertz", [(0.0, 1.0), (2e-4, 0.3), (2e-4, 1.0), (2e-3, 2.0), (0.02, 2.0)]
)
def test_the_error_is_as_stated(wander, hertz):
    """Its root mean square over ten recordings agrees with the stated error to a
    factor of two."""
    rng = np.random.default_rng(0)
    ratios = []
    for _ in range(10):
        drive, true = _drive(wander, hertz, rng)
        found = drive.acceleration
        ratios.append(np.std(found.values - true) / found.stderr)
    assert 0.5 < math.sqrt(np.mean(np.square(ratios))) < 2.0


def test_a_fast_change_gets_shorter_parabolas():
    """At 2 Hz and 2 %, the error is below a tenth of the acceleration."""
    rng = np.random.default_rng(1)
    quick, true = _drive(0.02, 2.0, rng)
    slow, _ = _drive(0.0, 2.0, rng)
    assert quick.acceleration.length < 0.3 < slow.acceleration.length
    assert np.std(quick.acceleration.values - true) < 0.1 * np.std(true)


def test_a_short_recording_has_no_acceleration():
    """It is zero, with zero error, instead of the noise of one parabola."""
    rng = np.random.default_rng(2)
    drive, _ = _drive(0.0, 1.0, rng, speed=60.0, duration=0.3)
    assert not np.any(drive.acceleration.values)
    assert drive.acceleration.stderr == 0.0
