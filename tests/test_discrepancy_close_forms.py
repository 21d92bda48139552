"""Forms that almost represent a function that was found."""

import dataclasses
from types import SimpleNamespace

import pytest

from jaxcam.discrepancy.report._close_forms import close_forms
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._slots import Free
from jaxcam.discrepancy.terms import Family, Variable, Where
from jaxcam.discrepancy.terms._primitives import FORWARD, STEP


FAMILY = Family(Where.FLIGHT, Variable.VELOCITY, -1.0, 1.0)
BY_PLACE = dataclasses.replace(FAMILY, argument=Variable.POSITION)
CURVE = Free(FAMILY, Roughness(), "force_a")
FORM = dataclasses.replace(CURVE, primitive=FORWARD)


def _found(cost: float, *functions: Free, names=()):
    fit = SimpleNamespace(cost=cost)
    return SimpleNamespace(fit=fit, functions=functions, names=frozenset(names))


@pytest.mark.parametrize(
    ("other", "error"),
    [
        # a loss of 100 of 10^6 is an rms error of 1 %
        (_found(1100.0, FORM), 0.01),
        # the loss is more than the allowed fraction
        (_found(41_000.0, FORM), None),
        # another function, other terms, and no form
        (_found(1100.0, dataclasses.replace(FORM, family=BY_PLACE)), None),
        (_found(1100.0, FORM, names={"coulomb_friction"}), None),
        (_found(1100.0, CURVE), None),
    ],
    ids=["close", "far", "other function", "other terms", "curve"],
)
def test_a_form_is_close_if_it_leaves_little_of_what_the_curve_explains(
    other, error, unchecked_types
):
    found = close_forms(_found(1000.0, CURVE), [other], {"flight velocity": 1e6}, 0.02)
    kept = found.get("force_a")
    assert (kept is None) == (error is None)
    if kept is not None:
        assert kept.error == pytest.approx(error)
        assert kept.form is FORM


def test_the_best_of_several_forms_is_taken(unchecked_types):
    """The others are given in the order of their scores; a better cost is exact."""
    step = dataclasses.replace(CURVE, primitive=STEP)
    others = [_found(900.0, FORM), _found(1001.0, step)]
    kept = close_forms(_found(1000.0, CURVE), others, {"flight velocity": 1e6}, 0.02)[
        "force_a"
    ]
    assert kept.form is FORM and kept.error == 0.0
    assert kept.percent == 0.01


def test_the_error_is_relative_to_the_function_itself(unchecked_types):
    """Of two functions, one form loses 2 % of the smaller one, but nothing of both."""
    place = dataclasses.replace(CURVE, family=BY_PLACE, slot="force_b")
    explained = {"flight velocity": 1e4, "flight position": 1e6}
    other = _found(1300.0, FORM, place)
    assert not close_forms(_found(1000.0, CURVE, place), [other], explained, 0.02)


def test_a_fit_that_differs_in_two_functions_does_not_count(unchecked_types):
    """A better curve of one would hide the loss by the form of the other."""
    place = dataclasses.replace(CURVE, family=BY_PLACE, slot="force_b")
    of_place = dataclasses.replace(place, primitive=STEP)
    explained = {"flight velocity": 1e6, "flight position": 1e6}
    other = _found(990.0, FORM, place)
    assert not close_forms(_found(1000.0, CURVE, of_place), [other], explained, 0.02)


def test_without_an_explained_cost_nothing_is_close(unchecked_types):
    for explained in ({}, {"flight velocity": 0.0}, {"flight velocity": -5.0}):
        other = _found(1000.0, FORM)
        assert not close_forms(_found(1000.0, CURVE), [other], explained, 0.02)
