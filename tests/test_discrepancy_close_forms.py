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
    found = close_forms(_found(1000.0, CURVE), [other], 1e6, 0.02)
    kept = found.get("force_a")
    assert (kept is None) == (error is None)
    if kept is not None:
        assert kept.error == pytest.approx(error)
        assert kept.form is FORM


def test_the_best_of_several_forms_is_taken(unchecked_types):
    """The others are given in the order of their scores; a better cost is exact."""
    step = dataclasses.replace(CURVE, primitive=STEP)
    others = [_found(900.0, FORM), _found(1001.0, step)]
    kept = close_forms(_found(1000.0, CURVE), others, 1e6, 0.02)["force_a"]
    assert kept.form is FORM and kept.error == 0.0
    assert kept.percent == 0.01
