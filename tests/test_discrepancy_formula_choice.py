"""Which forms are fitted in place of a free function, and which one is kept."""

import types

import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search import _formulas


def _trial(score, cost=1000.0):
    samples = types.SimpleNamespace(samples=1000)
    one = types.SimpleNamespace(slot="force_a", smooth=True)
    found = types.SimpleNamespace(cost=cost, problem=samples)
    return types.SimpleNamespace(score=score, functions=(one,), fit=found)


@pytest.fixture
def chosen(monkeypatch, unchecked_types):
    """The form that is kept, and those that were fitted, for predicted gains and
    scores; the curve has a score of 1000."""

    def choose(forms):
        tried = []
        curve = _trial(1000.0)
        ranked = [(gain, name, None) for name, (gain, _) in forms.items()]

        def fitted(fits, found, apart, one, primitive, numbers, small):
            tried.append(primitive.name)
            score = forms[primitive][1]
            return None if score is None else _trial(score)

        monkeypatch.setattr(_formulas, "_promising", lambda *_: ranked)
        monkeypatch.setattr(_formulas, "_sound", lambda *_: True)
        monkeypatch.setattr(_formulas, "_fitted", fitted)
        fits = types.SimpleNamespace(policy=Policy())
        found, _ = _formulas.formulated(fits, curve, None, 1e5, lambda *_: None)
        return found.score, tried

    return choose


class Form(str):
    """A form that is only a name."""

    @property
    def name(self):
        return str(self)


def test_a_form_that_promises_less_is_not_fitted(chosen):
    """The first has more evidence than the curve; the second promises 7000 less."""
    arc, bump = Form("arc"), Form("bump")
    score, tried = chosen({arc: (13_900.0, 880.0), bump: (6_900.0, 500.0)})
    assert tried == ["arc"] and score == 880.0


def test_of_forms_that_promise_as_much_the_better_one_is_kept(chosen):
    bump, window = Form("bump"), Form("window")
    score, tried = chosen({bump: (16_345.0, 990.0), window: (16_320.0, 900.0)})
    assert tried == ["bump", "window"] and score == 900.0


def test_a_form_with_less_evidence_than_the_curve_is_not_kept(chosen):
    """Within ten, a tie, the form is preferred; a fit that fails does not count."""
    step, wave = Form("step"), Form("wave")
    assert chosen({step: (50.0, None), wave: (40.0, 1011.0)})[0] == 1000.0
    assert chosen({step: (50.0, 1009.0), wave: (40.0, 1011.0)})[0] == 1009.0
