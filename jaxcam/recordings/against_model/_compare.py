"""Compare recordings with a model, flight by flight.

A simulation from one initial state would soon diverge from the recording, because
impacts magnify every error. Here each flight starts from its measured initial state, so
the residual shows the model discrepancy in each mode: in flight, in contact or at
impacts.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from ...hybrid import HybridSystem
from ...models import CamFollower
from .._errors import RecordingError
from .._rig import Rig
from ..cut import measured_noise, Segments
from ._comparison import Comparison, merge, Residuals
from ._flight_fit import Observe
from ._mode_residuals import at_impacts, in_contact, in_flight


def compare(
    system: HybridSystem,
    segments: Segments,
    *,
    observe: Observe | None = None,
    noise: dict[str, float] | None = None,
    clock: Float[np.ndarray, " k"] | None = None,
) -> Comparison:
    """Compare one recording with a model.

    Args:
        system: The model. A `CamFollower` is compared at the measured angle of its cam,
            regardless of its own speed.
        segments: The segmented recording.
        observe: The channels to compare, each with the index of the state component
            that it measures, as in `{"height_m": 0}`, or with a function of the state.
            By default, the segmented channel measures the first component.
        noise: Standard deviations of the channels; by default estimated from the
            recording.
        clock: Time of the model at each sample (s); by default that of the segments,
            or, for a `CamFollower`, the time at which its cam has the measured angle.

    Returns:
        A comparison.

    Raises:
        RecordingError: A channel is missing.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import Recording, compare, segment
        >>> ball, time = BouncingBall(), np.linspace(0.0, 1.0, 1001)
        >>> motion = jaxcam.simulate(ball, [1.0, 0.0], 0.0, 1.0)
        >>> height = np.random.default_rng(0).normal(motion.at(time)[:, 0], 1e-4)
        >>> run = Recording("run", time, {"height_m": height})
        >>> parts = segment(run, "height_m", 0.0)
        >>> compare(ball, parts).row("flight").ratio < 2
        True
    """
    observe = dict(observe or {segments.channel: 0})
    known = {segments.channel: segments.noise, **(noise or {})}
    recording = segments.recording
    for channel in observe:
        if channel not in known:
            known[channel] = measured_noise(recording[channel])
        if not known[channel] > 0:
            raise RecordingError(
                f"{recording.name}: the noise of `{channel}` cannot be measured; give "
                f"it as noise={{{channel!r}: ...}}."
            )
    if clock is None:
        clock = _clock(system, segments)
    system = system.prepared()
    parts: list[Residuals] = []
    notes: list[str] = []
    flown, note = in_flight(system, segments, observe, known, clock)
    parts += flown
    notes += note
    if segments.channel in observe:
        pick = observe[segments.channel]
        parts += in_contact(system, segments, pick, clock)
        parts += at_impacts(system, segments, pick, clock)
    return Comparison(tuple(parts), tuple(notes))


def compare_case(
    rig: Rig,
    case: Sequence[Segments],
    *,
    progress: Callable[[float], None] | None = None,
) -> Comparison:
    """Compare all recordings of a cam-follower with its nominal model.

    The example continues the one in [`jaxcam.recordings.segment_case`][].

    Args:
        rig: The model; `rig.replace(...)` changes its values.
        case: Segments from `segment_case`.
        progress: Called with the completed fraction.

    Returns:
        A comparison.

    Raises:
        RecordingError: A recording was segmented without its drive.

    Examples:
        >>> from jaxcam.recordings.against_model import compare_case
        >>> found = compare_case(read_rig(DEMO_RIG / "rig.toml"), parts[:1])
        >>> [(row.mode, f"{row.ratio:.0f}") for row in found.rows[:2]]  # rms / noise
        [('flight', '2'), ('contact', '24')]
    """
    found = []
    for segments in case:
        if segments.drive is None:
            raise RecordingError(
                f"{segments.recording.name}: the recording was segmented without its "
                f"drive; use `segment_case`, or `compare` with a system of your own."
            )
        system = rig.system(segments.drive.speed, segments.drive.phase)
        found.append(compare(system, segments))
        if progress is not None:
            progress(len(found) / len(case))
    return merge(found)


def _clock(system: HybridSystem, segments: Segments) -> Float[np.ndarray, " k"]:
    """Return the time at which the cam of the model has the recorded angle."""
    if isinstance(system, CamFollower) and segments.drive is not None:
        speed, phase = float(system.speed), float(system.phase)
        return (segments.drive.angle - phase) / speed
    return segments.clock
