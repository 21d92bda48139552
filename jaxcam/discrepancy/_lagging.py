"""Repeat a diagnosis without the lag of a sensor that it has found.

A fit expands the motion in powers of a lag. The expansion is accurate for a lag of one
or two samples, but not for one that is as long as the time scale of the motion: the lag
is then wrong, and the error looks like further missing physics.
"""

from collections.abc import Sequence

from ..fitting import without_lags
from ..recordings import Recording, Segments
from .report import Diagnosis
from .terms import SensorLag, watching


def long_lag(
    found: Diagnosis, recordings: Sequence[Recording | Segments]
) -> dict[str, float]:
    """Return the lag that a diagnosis has named (s), by its channel, if more of it can
    be removed from the recordings than was removed before; empty otherwise.
    """
    lag, model = _named(found), found.after.problem.model
    whole = [run for run in recordings if isinstance(run, Recording)]
    if lag is None or len(whole) < len(recordings):
        return {}
    channel = watching(model)
    moved, _ = without_lags(model, whole, {channel: lag})
    before, after = (one.sensors[channel].removed_lag for one in (model, moved))
    return {channel: lag} if float(after) > float(before) else {}


def more_accurate(again: Diagnosis, found: Diagnosis) -> bool:
    """Return whether the diagnosis of moved samples also names the lag, and predicts at
    least as well as the one before.
    """
    return _named(again) is not None and again.heldout_after <= found.heldout_after


def _named(found: Diagnosis) -> float | None:
    for one in found.effects:
        if one.name == SensorLag.name:
            return one.parameters["lag"].value
    return None
