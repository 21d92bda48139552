"""Segment recordings of any system into flights, contacts and impacts."""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from .._drive import Drive, read_drive
from .._recording import Case, Recording
from .._rig import Rig
from ._cut import cut
from ._hidden_hops import before_release, may_hop, sure_contact
from ._impact_points import impact_points, touched_points
from ._motion import Motion
from ._placed import placed
from ._polynomial import measured_noise
from ._segments import Boundary, Flight, impacts_of, Segments
from ._surface import Surface
from ._surface_drift import surface_drifts
from ._surface_fit import fit_surface, refine_surface


# number of refinements of the surface, each based on the contacts found before
_REFINED = 2


def segment_case(
    recordings: Case | Sequence[Recording],
    rig: Rig,
    *,
    channel: str = "follower_angle_rad",
    surface: Surface | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Segments, ...]:
    """Segment all recordings of a cam-follower rig, with one surface for all of them.

    Args:
        recordings: A `Case`, or any recordings of the same rig.
        rig: The rig, with nominal geometry, tolerances and sensors.
        channel: The channel of the follower.
        surface: The surface of the cam, if known; by default, it is estimated from the
            impacts and contacts of all recordings, and so is a displacement of the
            surface in the course of time.
        progress: Called with the completed fraction.

    Returns:
        The segments of each recording.

    Raises:
        RecordingError: A channel is missing, or the angle of the cam cannot be used.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.recordings import read_case, read_rig, segment_case
        >>> parts = segment_case(read_case(DEMO_RIG), read_rig(DEMO_RIG / "rig.toml"))
        >>> parts[0].impacts.count > 0
        True
    """
    recordings = tuple(recordings)
    drives = [read_drive(recording) for recording in recordings]
    drifts = [np.zeros(len(recording)) for recording in recordings]

    passes = 1 if surface is not None else _REFINED + 1
    done = 0

    def cut_all(surface):
        nonlocal done
        parts = []
        for recording, drive, drift in zip(recordings, drives, drifts):
            parts.append(_segment_rig(recording, rig, drive, surface, channel, drift))
            done += 1
            if progress is not None:
                progress(done / (passes * len(recordings)))
        return tuple(parts)

    if surface is not None:
        return cut_all(surface)
    surface = fit_surface(recordings, rig, drives, channel)
    noise = rig.sensors.follower_floor
    seen = [impact_points(*pair, channel, noise) for pair in zip(recordings, drives)]
    moved = surface_drifts(recordings, drives, surface, seen, noise)
    if moved is not None:
        drifts = moved
        still = [_still(*pair, channel) for pair in zip(recordings, drifts)]
        surface = fit_surface(still, rig, drives, channel)
    for _ in range(_REFINED):
        parts = cut_all(surface)
        still = [_on_still(*pair) for pair in zip(parts, drifts)]
        surface = refine_surface(surface, rig, still)
        if moved is not None:
            seen = [touched_points(part) for part in parts]
            again = surface_drifts(recordings, drives, surface, seen, noise)
            drifts = again or drifts
    return cut_all(surface)


def _still(recording: Recording, drift, channel: str) -> Recording:
    """Return a recording without the displacement of the surface."""
    channels = {**recording.channels, channel: recording[channel] - drift}
    return dataclasses.replace(recording, channels=channels)


def _on_still(part: Segments, drift) -> Segments:
    """Return segments without the displacement of the surface."""
    time = part.recording.time
    there = np.interp(part.impacts.time, time, drift)
    return dataclasses.replace(
        part,
        recording=_still(part.recording, drift, part.channel),
        impacts=dataclasses.replace(part.impacts, angle=part.impacts.angle - there),
    )


def segment(
    recording: Recording,
    channel: str,
    contact: Float[np.ndarray, " k"] | float | None = None,
    *,
    contact_rate: Float[np.ndarray, " k"] | None = None,
    upper: Float[np.ndarray, " k"] | float | None = None,
    upper_rate: Float[np.ndarray, " k"] | None = None,
    tolerance: float = 0.0,
    noise: float | None = None,
    restitution: float = 0.5,
) -> Segments:
    """Segment a recording of a system with one constraint, or two facing constraints.

    Args:
        recording: The recording.
        channel: The channel of the motion.
        contact: Position of the lower surface at each sample, in the units of the
            channel, shape `(k,)` or one number. If both `contact` and `upper` are
            `None`, the entire recording is one flight.
        contact_rate: Rate of change of `contact`; by default computed from its
            differences.
        upper: Position of a second surface, above the motion, such as the upper of two
            stops.
        upper_rate: Rate of change of `upper`.
        tolerance: Largest error of the stated position of each surface, in the units of
            the channel; each surface is shifted by at most this amount to match the
            impacts.
        noise: Standard deviation of a sample; by default estimated from the recording.
        restitution: Expected coefficient of restitution, for impacts too weak to be
            observed.

    Returns:
        The segmented recording. Every impact in `impacts` has a positive approach
            speed.

    Raises:
        ValueError: A surface does not have one number per sample, or the upper surface
            is not above the lower one.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import Recording, segment
        >>> ball, time = BouncingBall(), np.linspace(0.0, 1.0, 1001)
        >>> motion = jaxcam.simulate(ball, [1.0, 0.0], 0.0, 1.0)
        >>> height = np.random.default_rng(0).normal(motion.at(time)[:, 0], 1e-4)
        >>> run = Recording("run", time, {"height_m": height})
        >>> parts = segment(run, "height_m", 0.0)
        >>> parts.impacts.count
        1
    """
    samples = recording[channel]
    noise = noise or measured_noise(samples)
    if contact is None and upper is None:
        return _one_flight(recording, channel, noise)
    sides = []
    for name, place, rate in (
        ("contact", contact, contact_rate),
        ("upper", upper, upper_rate),
    ):
        if place is None:
            continue
        place = _each_sample(name, place, recording)
        if rate is None:
            rate = np.asarray(np.gradient(place, recording.time))
        side = Motion(
            time=recording.time,
            samples=samples,
            contact=place,
            rate=_each_sample(f"{name}_rate", rate, recording),
            noise=noise,
            interval=recording.interval,
        )
        sides.append(
            side if name == "contact" else side.mirrored(side.contact, side.rate)
        )
    if len(sides) == 2 and np.any(-sides[1].contact <= sides[0].contact):
        raise ValueError(
            "`upper` is not above `contact` at every sample; give the surface below "
            "the motion as `contact` and the one above it as `upper`."
        )
    if tolerance > 0:
        sides = [placed(side, tolerance) for side in sides]
    flights, contacts, impacts = cut(sides, restitution)
    return Segments(
        recording,
        channel,
        noise,
        recording.time,
        flights,
        contacts,
        impacts,
        gap=np.min([side.gap for side in sides], axis=0),
    )


def _each_sample(name: str, values, recording: Recording) -> Float[np.ndarray, " k"]:
    try:
        return np.broadcast_to(np.asarray(values, float), recording.time.shape).copy()
    except ValueError:
        raise ValueError(
            f"`{name}` has shape {np.shape(values)} for {len(recording)} samples; give "
            f"one number, or one for each sample."
        ) from None


def _segment_rig(recording, rig: Rig, drive: Drive, surface: Surface, channel, drift):
    contact = surface.angle(drive.angle) + drift
    rate = surface.slope(drive.angle) * drive.rate
    rate = rate + np.gradient(drift, recording.time)
    found = segment(
        recording,
        channel,
        contact,
        contact_rate=rate,
        noise=rig.sensors.follower_floor,
        restitution=rig.restitution.value,
    )
    turned = np.interp(found.impacts.time, recording.time, drive.angle)
    error = surface.slope_stderr(turned) * drive.speed
    releases = [c.stop.time for c in found.contacts if c.stop.kind == "release"]
    seen = np.searchsorted(recording.time, releases)
    seen = np.minimum(seen, len(recording) - 1)
    sure = sure_contact(may_hop(rig, drive), seen)
    last = found.contacts[-1] if found.contacts else None
    if last is not None and last.stop.kind == "end of record":
        sure &= before_release(drive.angle, last.first, seen)
    return dataclasses.replace(
        found,
        clock=drive.clock,
        drive=drive,
        surface=surface,
        sure=sure,
        impacts=dataclasses.replace(found.impacts, turned=turned, surface_stderr=error),
    )


def _one_flight(recording, channel, noise) -> Segments:
    why = "no surface was given, so the whole recording is one flight"
    start, stop = (
        Boundary(float(recording.time[i]), float("nan"), "end of record", why)
        for i in (0, -1)
    )
    height = float(np.ptp(recording[channel]))
    flight = Flight(start, stop, 0, len(recording), height)
    clock = recording.time
    return Segments(recording, channel, noise, clock, (flight,), (), impacts_of([]))
