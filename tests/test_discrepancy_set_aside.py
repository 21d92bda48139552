"""A recording that is inconsistent with the others: misread, or physics of its own?"""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from jaxcam.discrepancy import _set_aside, Policy, Verdict
from jaxcam.discrepancy._set_aside import (
    not_set_aside,
    set_aside,
    visits_own_states,
)
from jaxcam.discrepancy.report import Reason
from jaxcam.discrepancy.search._question import check_runs
from jaxcam.recordings import Recording, RecordingError


_TIME = np.linspace(0.0, 1.0, 401)


def _problem(own, *, filled=None, channel="angle_rad", speed=1.0, approach=()):
    """Four recordings of a sine, and one with other samples in one channel.

    **Arguments:** `speed`: size of the velocities of the last recording, relative to
    those of the others; `approach`: its approach speeds.
    """
    wave = np.sin(30 * _TIME)
    runs = [
        Recording(f"run{k}", _TIME, {"angle_rad": size * wave})
        for k, size in enumerate((1.0, 0.9, 1.0, 0.8), start=1)
    ]
    runs.append(Recording("run5", _TIME, {channel: own}, filled=filled))
    states = np.stack([wave[::10], np.cos(30 * _TIME[::10])], axis=1)
    slow = SimpleNamespace(approach=np.array([0.1, 0.2]))
    own_impacts = SimpleNamespace(approach=np.array(approach))
    return SimpleNamespace(
        records=tuple(run.name for run in runs),
        segments=[
            SimpleNamespace(recording=run, impacts=own_impacts if k == 4 else slow)
            for k, run in enumerate(runs)
        ],
        model=SimpleNamespace(sensors={"angle_rad": None}),
        pieces=SimpleNamespace(exists=np.ones((5, len(states)), dtype=bool)),
        start=SimpleNamespace(states=np.stack([states] * 4 + [states * [1.0, speed]])),
    )


_WAVE = np.sin(30 * _TIME)


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(
    ("given", "alone"),
    [
        ({"own": 0.95 * _WAVE}, False),
        # within a margin of 5 % of the range, of two units
        ({"own": 1.09 * _WAVE}, False),
        ({"own": 1.15 * _WAVE}, True),
        ({"own": 2.0 * _WAVE}, True),
        # one sample in a hundred
        ({"own": np.where(np.arange(401) % 100 == 0, 5.0, _WAVE)}, False),
        ({"own": np.where(np.arange(401) % 10 == 0, 5.0, _WAVE)}, True),
        ({"own": _WAVE, "speed": 10.0}, True),
        ({"own": _WAVE, "approach": (0.15, 0.9)}, True),
        ({"own": _WAVE, "approach": (0.15, 0.18)}, False),
        # samples that were not measured do not count, neither among those inside
        ({"own": 2.0 * _WAVE, "filled": np.ones(401, dtype=bool)}, False),
        ({"own": np.where(np.arange(401) < 380, np.nan, 5.0)}, True),
        ({"own": 2.0 * _WAVE, "channel": "not_modelled"}, False),
    ],
)
def test_a_recording_visits_states_of_its_own(given, alone):
    problem = _problem(**given)
    assert visits_own_states(problem, "run5", Policy()) is alone  # pyright: ignore


@pytest.mark.usefixtures("unchecked_types")
def test_a_spike_in_another_recording_hides_no_states():
    problem = _problem(2.0 * _WAVE)
    problem.segments[0].recording["angle_rad"][7] = 50.0
    assert visits_own_states(problem, "run5", Policy())  # pyright: ignore


@dataclasses.dataclass
class _Found:
    """What is read of a diagnosis."""

    verdict: Verdict
    after: dict | None = None
    caveats: tuple = ()
    policy: Policy = Policy()


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(
    ("short", "said"),
    [(False, "What is missing acts in"), (True, "unidentified physics acts in")],
)
def test_a_result_that_rests_on_one_recording_has_a_caveat(monkeypatch, short, said):
    monkeypatch.setattr(_set_aside, "falls_short", lambda found: short)
    found = not_set_aside(_Found(Verdict.UNKNOWN), "run5")  # pyright: ignore
    (caveat,) = found.caveats
    assert caveat.reason is Reason.SET_ASIDE
    assert "Without the recording run5, nothing is missing" in caveat.sentence
    assert said in caveat.sentence


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(("left", "excluded"), [(1.0, True), (50.0, False)])
def test_a_recording_is_excluded_if_the_others_are_explained(
    monkeypatch, left, excluded
):
    """`left`: the cost per sample of the worst of the others."""
    costs = {f"run{k}": 1.0 for k in range(1, 5)}
    monkeypatch.setattr(_set_aside, "cost_by_record", lambda found: found)
    monkeypatch.setattr(_set_aside, "_worst_time", lambda found, name: 2.2)
    found = _Found(Verdict.UNKNOWN, {**costs, "run5": 100.0})
    again = _Found(Verdict.EFFECT, {**costs, "run1": left})
    chosen = set_aside(found, again, "run5")  # pyright: ignore
    assert chosen.verdict is (Verdict.EFFECT if excluded else Verdict.UNKNOWN)
    (caveat,) = chosen.caveats
    assert ("run5 is excluded" in caveat.sentence) is excluded
    assert "The residual of run5 is largest near 2.2 s." in caveat.sentence


@pytest.mark.usefixtures("unchecked_types")
def test_the_place_of_the_largest_residual():
    """The beginning of the piece with the largest cost, joint included, that exists."""
    pieces = SimpleNamespace(
        exists=np.array([[True, True, True], [True, True, False]]),
        flown=SimpleNamespace(start=np.array([[0.0, 1.0, 2.0], [0.5, 1.5, 2.5]])),
    )
    problem = SimpleNamespace(records=("run1", "run2"), pieces=pieces)
    costs = SimpleNamespace(
        flown=np.array([[5.0, 9.0, 1.0], [5.0, 1.0, 99.0]]),
        joints=np.array([[0.0, 0.0, 9.5], [0.0, 3.0, 0.0]]),
    )
    found = SimpleNamespace(problem=problem, costs=costs)
    assert _set_aside._worst_time(found, "run1") == 2.0  # pyright: ignore
    assert _set_aside._worst_time(found, "run2") == 0.5  # pyright: ignore


def test_recordings_of_the_same_name_are_refused():
    runs = [Recording("run", _TIME, {"angle_rad": _WAVE})] * 2
    with pytest.raises(RecordingError, match="More than one recording is called 'run'"):
        check_runs(runs)
