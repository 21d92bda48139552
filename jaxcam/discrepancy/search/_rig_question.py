"""The problem of a cam-follower rig."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...fitting import (
    cam_follower_model,
    cam_follower_parameters,
    Model,
    Problem,
    without_lags,
)
from ...recordings import Recording, RecordingError, Rig, segment_case
from ...recordings.cut import Segments
from ...recordings.files import check_channels, check_drive
from ..policy import Policy
from ..terms import base_drive, library, watched, WithTerms
from ._motion_scales import motion_scales
from ._question import (
    by_listing,
    Candidates,
    check_runs,
    Question,
    Report,
    Shown,
    term_parameters,
    with_seen_noise,
)


_FOLLOWER = "follower_angle_rad"
# Number of angles of the nominal cam used to check the sign of a recording
_ANGLES = 64


def rig_question(
    rig: Rig,
    recordings: Sequence[Recording | Segments],
    candidates: Candidates,
    report: Report,
    policy: Policy,
    lags: Mapping[str, float],
) -> Question:
    """Return the problem of a cam-follower rig; the rig contains sensors and
    tolerances, and `lags` (s) are those of its channels, if known.

    **Raises:** `RecordingError` for recordings that cannot be those of the rig.
    """
    runs = tuple(recordings)
    check_runs(runs)
    _check(rig, [r.recording if isinstance(r, Segments) else r for r in runs])
    report("finding impacts and contacts", None)
    base = cam_follower_model(rig)
    cut = [run for run in runs if isinstance(run, Segments)]
    if len(cut) < len(runs):
        base, whole = without_lags(base, runs, lags)  # pyright: ignore
        cut = list(segment_case(whole, rig))
    if candidates is None or isinstance(candidates, str):
        extended = candidates is not None
        candidates = library(references=rig.references, extended=extended)
    own = [part.recording for part in cut]
    sensors, noisier = with_seen_noise(base.sensors, own, policy)
    slip = rig.references.slip_speed
    scales = motion_scales(own, _FOLLOWER, sensors[_FOLLOWER], slip)
    terms, unlisted = by_listing(tuple(term.scaled(scales) for term in candidates))
    model = watched(Model(WithTerms(base.system, terms), sensors, base_drive()))
    parameters = cam_follower_parameters(rig, base=lambda s: s.base)
    names = tuple(p.name for p in parameters)
    report("preparing the fits", None)
    problem = Problem.build(
        model, cut, parameters + term_parameters(terms, cut, policy)
    )
    # the recordings determine only the ratio of stiffness and inertia
    stiffness = Shown("K/J", rig.inertia.value, "1/(m^2 s^2)")
    return Question(
        problem=problem,
        rig=names,
        terms=terms,
        unlisted=unlisted,
        turned=True,
        unit="rad",
        references=rig.references,
        drives=tuple(run.recording for run in cut),
        drive_noise=rig.sensors.cam_floor,
        shown={"stiffness": stiffness},
        noisier=noisier,
    )


def _check(rig: Rig, runs: Sequence[Recording]) -> None:
    """Reject recordings that cannot be those of the rig.

    **Raises:** `RecordingError`, which names the recording and its fault.
    """
    surface = rig.system(1.0)
    angles = np.asarray(surface.contact_angle(np.linspace(0, 2 * np.pi, _ANGLES)))
    low, high = float(angles.min()), float(angles.max())
    for run in runs:
        check_channels(run)
        check_drive(run)
        samples = run[_FOLLOWER]
        least = float(np.min(samples))
        # the lowest angle of the follower must be near the range of those of the cam
        room = (high - low) / 2
        if least >= low - room and least <= high:
            continue
        if low - room <= float(np.min(-samples)) <= high:
            raise RecordingError(
                f"{run.name}: `{_FOLLOWER}` has the wrong sign for this rig, whose "
                f"follower is between {low:.3g} and {high:.3g} rad on the cam; "
                f"multiply the column by -1."
            )
        raise RecordingError(
            f"{run.name}: the smallest value of `{_FOLLOWER}` is {least:.3g} rad, "
            f"whereas on this cam the angle is between {low:.3g} and {high:.3g} rad; "
            "check that the column and the rig file belong to this recording, and "
            "that the unit is rad."
        )
