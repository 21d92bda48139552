"""Doubtful terms that are named because no discrepancy remains with them."""

from types import SimpleNamespace
from typing import Any

import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence import _supported


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize("lost", (10.0, 100.0))
def test_a_doubtful_term_that_explains_little_is_not_named(monkeypatch, lost):
    """With an error of 15 % in the form of the certain term, 22.5 of the 1000 that both
    explain may remain.
    """
    costs = {"before": 2000.0, "best": 1000.0 + lost, "found": 1000.0}
    trials: dict[str, Any] = {
        name: SimpleNamespace(
            name=name, names=frozenset({name}), fit=SimpleNamespace(cost=cost)
        )
        for name, cost in costs.items()
    }
    before, best, found = trials.values()

    def left(question, fits, trial):
        return [SimpleNamespace(significant=trial is not found)]

    held = SimpleNamespace(before=2.0, after=1.0)
    replaced = {
        "unmasked": lambda fits, trial: (trial, []),
        "sure": lambda fits, trial, seed: (best, {}, {}, [("doubtful", 0.5)]),
        "_left": left,
        "held_out": lambda fits, one, other: held,
        "redrawn": lambda fits, trial, seed: ({}, {}),
        "_imitating": lambda structures, policy: None,
        "_instead": lambda fits, trial, deviation: ([], trial),
    }
    for name, function in replaced.items():
        monkeypatch.setattr(_supported, name, function)
    fits: Any = SimpleNamespace(
        policy=Policy(),
        progress=lambda *args: None,
        known={frozenset(): before},
        terms=(),
    )
    question: Any = None
    named = _supported.supported(question, fits, found, 0)
    assert named.best is (found if lost > 22.5 else best)
    assert bool(named.needed) == (lost > 22.5)
    assert bool(named.doubtful) == (lost < 22.5)
