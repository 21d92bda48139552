"""Runs that once went wrong, each with what was wrong."""

import jax.numpy as jnp
import numpy as np

import jaxcam
from jaxcam.hybrid import stroboscope
from jaxcam.models import BouncingBall, CamFollower, rpm_to_rad_s


def test_release_point_start_reaches_the_end():
    # the first step after a release once ran out of attempts
    system = CamFollower(speed=rpm_to_rad_s(155.0))
    trajectory = jaxcam.simulate(system, None, 0.0, 12.0)
    assert trajectory.successful, trajectory.result


def test_hops_as_low_as_rounding_do_not_hold_up_a_batch():
    # near its release at 150.82 rpm a lane once spent a thousand attempts on one hop
    speeds = np.linspace(130.0, 160.0, 256)[[100, 175, 177]]
    system = CamFollower()
    start = np.array([float(system.contact_angle(0.0)) + 0.02, 0.0])
    made = stroboscope(
        system,
        start,
        70,
        where=lambda s: s.speed,
        values=rpm_to_rad_s(speeds),
    )
    assert np.all(made.code == 0)
    assert np.all(made.steps <= 3 * made.impacts + 12 * 70)


def test_landing_is_not_mistaken_far_from_the_surface():
    # the series for the landing time vanishes by accident far below the table
    hexadecimal = (
        "0x1.433e76f6c78f6p+3",
        "0x1.7327c839adcf5p-3",
        "0x1.86c55c905a6ebp-5",
        "0x1.8d8e11facc012p+4",
    )
    gravity, restitution, amplitude, frequency = map(float.fromhex, hexadecimal)
    system = BouncingBall(
        gravity=gravity,
        restitution=restitution,
        amplitude=amplitude,
        frequency=frequency,
    )
    start = jnp.array([0.54248909, -1.02249612])
    trajectory = jaxcam.simulate(system, start, 0.3, 3.0, tolerance=1e-6)
    assert trajectory.successful, trajectory.result
    assert float(trajectory.gap(np.linspace(0.3, 3.0, 2000)).min()) > -1e-9
