"""Whether an element with an internal state is tried, from its predicted gain."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search._clock import Clock
from jaxcam.discrepancy.search._element_need import ElementNeed
from jaxcam.discrepancy.search._free_fits import FreeFits, Missing
from jaxcam.fitting import Problem


_LEAST = 24.0
# what the predictions below do not use
_PROBLEM = object.__new__(Problem)


def _fit_of(cost):
    fit = SimpleNamespace(cost=cost, problem=SimpleNamespace(samples=1000))
    return Missing((), frozenset(), cast(Any, fit), 0.0, _PROBLEM)


_FIT = _fit_of(1500.0)


class _Predicted(ElementNeed):
    """Elements whose gain is given, before and after functions are added."""

    def __init__(self, before, after=0.0):
        super().__init__(FreeFits((), (), Policy()), None, Policy())
        self.each = [before, after]

    def _promised(self, problem, found, least):
        return self.each.pop(0)


@pytest.mark.parametrize(
    ("promised", "functions", "preferred", "comparable"),
    [
        (110.0, [100.0, 90.0], True, True),
        (60.0, [100.0, 90.0], False, True),
        (40.0, [100.0], False, False),
        # less than the false-alarm rate requires
        (20.0, [], False, False),
        (30.0, [], True, True),
    ],
)
def test_an_element_is_compared_with_the_functions(
    promised, functions, preferred, comparable
):
    need = _Predicted(promised)
    need.compare(_PROBLEM, _FIT, functions, _LEAST)
    assert (need.preferred, need.comparable) == (preferred, comparable)
    # nothing was found: an element is tried if it was comparable
    assert need.remains(_PROBLEM, None, _LEAST) == comparable


@pytest.mark.parametrize(("after", "needed"), [(20.0, False), (30.0, True)])
def test_an_element_may_explain_what_functions_leave(after, needed, unchecked_types):
    need = _Predicted(10.0, after)
    need.compare(_PROBLEM, _FIT, [1000.0], _LEAST)
    assert need.remains(_PROBLEM, _FIT, _LEAST) == needed


@pytest.mark.parametrize(("after", "needed"), [(480.0, False), (500.0, True)])
def test_far_from_the_data_an_element_must_explain_most(after, needed, unchecked_types):
    """Half of the 980 in units of the cost per sample, 50."""
    need = _Predicted(10.0, after)
    need.compare(_PROBLEM, _FIT, [1000.0], _LEAST)
    assert need.remains(_PROBLEM, _fit_of(50_000.0), _LEAST) == needed


def test_an_element_that_is_no_candidate_promises_nothing():
    need = ElementNeed(FreeFits((), (), Policy()), None, Policy(elements=0))
    need.compare(_PROBLEM, _FIT, [], _LEAST)
    assert not need.preferred
    assert not need.remains(_PROBLEM, None, _LEAST)


def test_a_limit_of_time_is_noticed_only_if_a_candidate_is_left_out():
    long, short = Clock(1.0), Clock(-1.0)
    assert not long.over and not long.stopped
    assert not short.stopped
    assert short.over and short.stopped


def test_the_time_of_other_programs_does_not_count(monkeypatch):
    """A search of one minute that has had 30 s of the processor in 2 min goes on."""
    wall, used = [0.0], [0.0]
    monkeypatch.setattr("time.monotonic", lambda: wall[0])
    monkeypatch.setattr("time.process_time", lambda: used[0])
    clock = Clock(1.0)
    wall[0], used[0] = 120.0, 30.0
    assert not clock.over
    # two threads
    wall[0], used[0] = 120.0, 61.0
    assert clock.over
    clock = Clock(1.0)
    wall[0], used[0] = 150.0, 121.0
    assert not clock.over
