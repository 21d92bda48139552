"""A recording that is inconsistent with the others: misread, or physics of its own?"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from jaxcam.discrepancy import _set_aside, Policy, Verdict
from jaxcam.discrepancy._set_aside import elsewhere, set_aside
from jaxcam.discrepancy.report import Reason
from jaxcam.recordings import Recording


_TIME = np.linspace(0.0, 1.0, 101)


@dataclasses.dataclass
class _Found:
    """What `set_aside` reads of a diagnosis."""

    verdict: Verdict
    after: SimpleNamespace
    policy: Policy = Policy()
    caveats: tuple = ()


def _problem(largest, channels=("angle_rad",)):
    """Four recordings of a sine of one unit, and one with another largest value."""
    sizes = (1.0, 0.9, 1.0, 0.8, largest)
    runs = [
        Recording(f"run{k}", _TIME, {"angle_rad": size * np.sin(6 * _TIME)})
        for k, size in enumerate(sizes, start=1)
    ]
    return SimpleNamespace(
        segments=[SimpleNamespace(recording=run) for run in runs],
        model=SimpleNamespace(sensors=dict.fromkeys(channels)),
    )


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(
    ("largest", "there"), [(0.95, False), (1.0, False), (2.0, True)]
)
def test_a_recording_beyond_the_range_of_the_others(largest, there):
    """Two thirds of the samples of a sine of twice the size are beyond one unit."""
    assert elsewhere(_problem(largest), "run5", Policy()) is there  # pyright: ignore


@pytest.mark.usefixtures("unchecked_types")
def test_channels_that_are_not_modelled_do_not_count():
    problem = _problem(2.0, channels=("speed_rad_s",))
    assert not elsewhere(problem, "run5", Policy())  # pyright: ignore


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(
    ("largest", "verdict", "kept"),
    [
        (1.0, Verdict.NONE, Verdict.NONE),
        (1.0, Verdict.EFFECT, Verdict.EFFECT),
        # the exception may contain the physics
        (2.0, Verdict.NONE, Verdict.UNKNOWN),
        (2.0, Verdict.EFFECT, Verdict.EFFECT),
    ],
)
def test_which_diagnosis_is_reported(monkeypatch, largest, verdict, kept):
    """`verdict` is that of the others, and the verdict on all recordings is unknown."""
    costs = {f"run{k}": 1.0 for k in range(1, 5)}
    every = SimpleNamespace(costs={**costs, "run5": 100.0}, problem=_problem(largest))
    others = SimpleNamespace(costs=costs)
    monkeypatch.setattr(_set_aside, "cost_by_record", lambda found: found.costs)
    found, again = _Found(Verdict.UNKNOWN, every), _Found(verdict, others)
    chosen = set_aside(found, again, "run5")  # pyright: ignore
    assert chosen.verdict is kept
    (caveat,) = chosen.caveats
    assert caveat.reason is Reason.SET_ASIDE
    assert ("run5 is excluded" in caveat.sentence) is (chosen.verdict is verdict)
    assert ("outside the range" in caveat.sentence) is (largest > 1.0)
