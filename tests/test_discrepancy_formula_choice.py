"""Which forms are fitted in place of a free function, and which one is kept."""

import types
from typing import Any, NamedTuple

import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search import _formulas, Clock


class _Fit(NamedTuple):
    cost: float
    problem: Any

    def __getitem__(self, name):
        return types.SimpleNamespace(value=float("abc".index(name)))


def _trial(score, cost=1000.0):
    samples = types.SimpleNamespace(samples=1000)
    one = types.SimpleNamespace(slot="force_a", smooth=True, coefficients="abc")
    found = _Fit(cost, samples)
    return types.SimpleNamespace(score=score, functions=(one,), fit=found, problem=None)


@pytest.fixture
def chosen(monkeypatch, unchecked_types):
    """The form that is kept, and those that were fitted, for predicted gains and
    scores of forms and of sums of them; the curve has a score of 1000."""

    def choose(forms, sums=(), gain=0.0, small=1e5):
        tried = []
        curve = _trial(1000.0)
        sums = dict(sums)
        scores = {name: score for name, (_, score) in (forms | sums).items()}

        def ranked(forms):
            return [
                _formulas.Start(gain, name, None)
                for name, (gain, _) in forms.items()
                if gain
            ]

        def fitted(self, start):
            _, primitive, numbers = start
            tried.append(primitive.name)
            if not primitive.special and numbers is not None:
                # the special case starts from the fitted numbers but the last
                assert numbers.tolist() == [0.0, 1.0]
            score = scores[primitive]
            return None if score is None else _trial(score, 1500.0)

        likelihood = types.SimpleNamespace(gain=gain, price=10.0, freedom=80.0)
        monkeypatch.setattr(
            _formulas,
            "CurveLikelihood",
            types.SimpleNamespace(about=lambda *_: likelihood),
        )
        monkeypatch.setattr(_formulas, "promising", lambda *_: ranked(forms))
        search = types.SimpleNamespace(promising=lambda _: ranked(sums))
        monkeypatch.setattr(_formulas, "SumSearch", lambda *_: search)
        monkeypatch.setattr(_formulas, "_sound", lambda *_: True)
        monkeypatch.setattr(_formulas, "friction_named", lambda *_: False)
        monkeypatch.setattr(_formulas._Trials, "_fitted", fitted)
        fits = types.SimpleNamespace(policy=Policy())
        found, _ = _formulas.formulated(
            fits, curve, None, small, lambda *_: None, Clock(1.0)
        )
        return found.score, tried

    return choose


class Form(str):
    """A form that is only a name."""

    special: tuple = ()
    count: int = 5

    @property
    def name(self):
        return str(self)


def special_case(form, applies=True):
    return types.SimpleNamespace(
        form=form, numbers=lambda p: p[:-1], applies=lambda _: applies
    )


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


def test_a_form_with_an_exponent_is_followed_by_that_of_one(chosen):
    """It starts from the fitted edge and may win although it promised too little."""
    power, line, bump = Form("power"), Form("line"), Form("bump")
    power.special = (special_case(line),)
    forms = {bump: (90.0, 950.0), power: (80.0, 970.0), line: (None, 930.0)}
    score, tried = chosen(forms)
    assert tried == ["bump", "power", "line"] and score == 930.0


def test_a_special_case_is_fitted_where_it_applies(chosen):
    zone, ramp, line = Form("dead zone"), Form("ramp"), Form("line")
    zone.special = special_case(ramp), special_case(line, applies=False)
    forms = {zone: (80.0, 970.0), ramp: (None, 960.0), line: (None, 900.0)}
    score, tried = chosen(forms)
    assert tried == ["dead zone", "ramp"] and score == 960.0


def test_a_form_is_fitted_once(chosen):
    """Its special case is among the promising forms as well."""
    power, line = Form("power"), Form("line")
    power.special = (special_case(line),)
    forms = {power: (80.0, 970.0), line: (79.0, 930.0)}
    assert chosen(forms)[1] == ["power", "line"]


def test_a_sum_is_fitted_if_no_form_alone_is_kept(chosen):
    """The curve has a gain of 5000 and parameters worth 80."""
    wave, both = Form("wave"), Form("wave + wave")
    sums = {both: (4930.0, 960.0)}
    score, tried = chosen({wave: (40.0, 1011.0)}, sums, gain=5000.0, small=100.0)
    assert tried == ["wave", "wave + wave"] and score == 960.0
    score, tried = chosen({wave: (40.0, 1009.0)}, sums, gain=5000.0, small=100.0)
    assert tried == ["wave"] and score == 1009.0


def test_a_sum_that_promises_less_than_the_curve_is_not_fitted(chosen):
    """By more than the 60 that are allowed for an inaccurate prediction: the price of
    the curve is 80, and that of the sum 50."""
    wave, both = Form("wave"), Form("wave + wave")
    for gain, fitted in ((4855.0, 1), (4865.0, 2)):
        sums = {both: (gain, 960.0)}
        _, tried = chosen({wave: (40.0, None)}, sums, gain=5000.0, small=100.0)
        assert len(tried) == fitted


def test_a_form_that_leaves_little_needs_no_sum(chosen):
    """It leaves 500 more than the curve, where 1000 are tolerated."""
    wave, both = Form("wave"), Form("wave + wave")
    sums = {both: (4930.0, 960.0)}
    _, tried = chosen({wave: (40.0, 1011.0)}, sums, gain=5000.0, small=1000.0)
    assert tried == ["wave"]


def test_forms_are_compared_on_pieces_where_the_curve_leaves_more(
    monkeypatch, unchecked_types
):
    """The curve costs three per sample. Of the forms, the one with the largest
    predicted gain costs more than twice the least on single pieces, and one fails."""
    forms = {"bump": 2313.0, "power": 1100.0, "line": 1050.0, "step": None}
    samples = types.SimpleNamespace(samples=1000)
    curve = _trial(3000.0, 3000.0)
    curve.problem, apart = samples, types.SimpleNamespace(samples=1000)
    tried = []

    def on_pieces(self, start):
        tried.append(start.primitive)
        cost = forms[start.primitive]
        return None if cost is None else _trial(cost + 10.0, cost)

    monkeypatch.setattr(_formulas._Trials, "_on_pieces", on_pieces)
    monkeypatch.setattr(_formulas, "_sound", lambda *_: True)
    monkeypatch.setattr(_formulas, "shows_apart", lambda family: True)
    fits = types.SimpleNamespace(policy=Policy())
    one = types.SimpleNamespace(family=None, slot="force_a")
    starts = [
        _formulas.Start(9e3 - k, Form(name), None) for k, name in enumerate(forms)
    ]

    def said(*words):
        pass

    def compared(found, apart):
        given = fits, found, apart, one, 1e5, said, Clock(1.0)
        return _formulas._Trials(*given).compared(starts)

    found = compared(curve, apart)
    assert tried == list(forms)
    assert [start.primitive for start in found] == ["line", "power"]
    # in the units of predicted gains, which are divided by the cost per sample
    assert [start.gain for start in found] == [-1060.0 / 3, -1110.0 / 3]
    # where the curve leaves noise alone, its predictions are reliable
    noise = _trial(1010.0, 1000.0)
    noise.problem = samples
    assert compared(noise, apart) == starts
    assert compared(curve, samples) == starts
