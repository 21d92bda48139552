"""Compute the coefficient of restitution from first rebounds, as in the thesis."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..hybrid import HybridSystem
from ..hybrid.programs import program
from ..hybrid.runge_kutta import array_step, RK4
from ..recordings import RecordingError, Segments
from .engine import Model, Turning


# Runge-Kutta steps of one flight
_STEPS = 200


def first_bounce(
    system: HybridSystem, segments: Segments, drive: Turning
) -> Float[np.ndarray, " turns"]:
    """Compute the coefficient of restitution from the height of the first rebound
    (thesis, section 4.6.1).

    In each period, the first impact after the release ends the highest flight. A
    simulation starts on the surface at that impact, with a separation speed such that
    the next flight rises as high above the cam as the recorded one; the coefficient is
    this speed divided by the recorded approach speed. Unlike a fit of whole
    trajectories, this method uses one number per period: the maximum of several noisy
    samples.

    The example continues the one in [`jaxcam.recordings.segment_case`][].

    Args:
        system: The system.
        segments: A segmented recording.
        drive: The measured drive.

    Returns:
        One coefficient for each period with such a pair of flights, shape `(periods,)`.

    Raises:
        RecordingError: The recording has no measured drive.

    Examples:
        >>> from jaxcam.fitting import first_bounce
        >>> from jaxcam.fitting.engine import cam_follower_drive
        >>> system = read_rig(DEMO_RIG / "rig.toml").system(parts[1].drive.speed)
        >>> found = first_bounce(system, parts[1], cam_follower_drive())
        >>> len(found), round(float(np.median(found)), 2)
        (9, 0.56)
    """
    impacts, flights = segments.impacts, segments.flights
    if segments.drive is None:
        raise RecordingError(
            f"{segments.recording.name}: the recording was segmented without its "
            f"drive; use `segment_case`."
        )
    time = segments.recording.time
    found = []
    for k in range(impacts.count):
        before = flights[impacts.flight[k]]
        after = flights[impacts.flight[k] + 1]
        if before.start.kind != "release" or impacts.approach[k] <= 0:
            continue
        at = impacts.time[k]
        angle = float(np.interp(at, time, segments.drive.angle))
        rate = float(np.interp(at, time, segments.drive.rate))
        speed = _speed_for_height(
            Model(system, {}, drive).uniform(angle, rate),
            float(impacts.angle[k]),
            float(after.duration),
            float(after.height),
        )
        found.append(float(speed) / impacts.approach[k])
    return np.array(found)


@program
def _speed_for_height(system, angle, duration, height) -> Array:
    """Find the separation speed of a flight of this `height` by bisection."""
    # the gap is the follower angle minus the contact angle
    contact = angle - system.gap(jnp.asarray(0.0), jnp.stack([angle, 0.0 * angle]))
    start = jnp.stack([contact, jnp.zeros_like(contact)])
    zero = jnp.zeros_like(contact)
    _, slope = jax.jvp(lambda t: system.gap(t, start), (zero,), (jnp.ones_like(zero),))
    h = 1.5 * duration / _STEPS

    def top(speed):
        def step(carry, _):
            t, x, highest = carry
            x, _, _ = array_step(RK4, system.vector_field, t, x, h)
            gap = system.gap(t + h, x)
            # a flight ends when the follower is back on the cam
            open_ = (highest >= 0) & (gap > 0)
            return (t + h, x, jnp.where(open_, jnp.maximum(highest, gap), highest)), gap

        x = jnp.stack([contact, -slope + speed])
        carry = (zero, x, zero)
        (_, _, highest), _ = jax.lax.scan(step, carry, None, length=_STEPS)
        return highest

    def halve(_, bounds):
        low, high = bounds
        middle = (low + high) / 2
        short = top(middle) < height
        return jnp.where(short, middle, low), jnp.where(short, high, middle)

    # upper bound of the speed: twice that of a parabola with this height and duration
    high = 8 * height / duration + 1e-9
    low, high = jax.lax.fori_loop(0, 40, halve, (zero, high + zero))
    return (low + high) / 2
