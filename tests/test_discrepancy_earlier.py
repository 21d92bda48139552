"""Functions found in some recordings, as the start of a search in others."""

import dataclasses
import math

import numpy as np
import pytest

from jaxcam.discrepancy.search._earlier import _over_range
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._slots import Free
from jaxcam.discrepancy.terms import Family, free_basis, Gate, Place, Variable, Where


WIDE = Family(Where.FLIGHT, Variable.POSITION, -0.3, 0.9)
NARROW = dataclasses.replace(WIDE, low=-0.1, high=0.6)
PHASE = Family(Where.FLIGHT, Variable.PHASE, 0.0, 2 * math.pi)
FAMILIES = {one.name: one for one in (NARROW, PHASE)}
ALONG = np.linspace(NARROW.low, NARROW.high, 201)


def _form(family, name):
    return next(one for one in family.primitives if one.name == name)


def _value(one, numbers):
    place = Place.between(ALONG, one.family.low, one.family.high)
    return one.primitive.value(place, numbers, np.zeros(len(ALONG)))


@pytest.mark.parametrize(
    "form",
    # the others are centred on the range; the rig parameters make up for that
    [one for one in WIDE.primitives if one.name not in ("straight", "square", "cube")],
    ids=lambda one: one.name,
)
def test_a_form_keeps_its_values_over_another_range(form):
    """To 2 % of its largest value: edges are smoothed over a fraction of the range, so
    that a jump is a little steeper over a smaller one.
    """
    numbers = np.array([0.7, *(one[len(one) // 2] for one in form.starts)])
    numbers[list(form.places)] = np.linspace(0.4, 0.6, len(form.places))
    before = Free(WIDE, Roughness(), "force_a", form)
    found = _over_range(before, numbers, FAMILIES)
    assert found is not None
    after, moved = found
    assert after.family == NARROW
    expected = _value(before, numbers)
    off = np.abs(_value(after, moved) - expected)
    assert np.mean(off) < 0.02 * np.max(np.abs(expected))


def test_a_sum_of_sines_keeps_its_values_over_another_range():
    """To 1 % of its largest value."""
    numbers = np.append(np.exp(-np.arange(20.0) / 3), 0.0)
    before = Free(WIDE, Roughness(), "force_a")
    found = _over_range(before, numbers, FAMILIES)
    assert found is not None
    after, moved = found
    old, new = (free_basis(f, ALONG, 21) for f in (WIDE, after.family))
    assert np.max(np.abs(new @ moved - old @ numbers)) < 0.01 * np.max(
        np.abs(old @ numbers)
    )


def test_a_product_keeps_its_size_and_its_edge():
    """The edge at 0.27 is at another fraction of the range; to 1e-3."""
    step, wave = _form(WIDE, "step"), _form(PHASE, "harmonic 1")
    edge = (0.27 - WIDE.low) / (WIDE.high - WIDE.low)
    before = Free(PHASE, Roughness(), "force_a", wave, Gate(WIDE, step))
    found = _over_range(before, np.array([0.4, 1.0, edge]), FAMILIES)
    assert found is not None
    after, moved = found
    assert after.gate is not None and after.gate.family == NARROW
    assert moved[:2] == pytest.approx([0.4, 1.0], rel=1e-2)
    low, high = NARROW.low, NARROW.high
    assert low + moved[2] * (high - low) == pytest.approx(0.27, abs=1e-3)


def test_a_function_whose_argument_is_not_offered_is_left_out():
    one = Free(WIDE, Roughness(), "force_a", _form(WIDE, "step"))
    assert _over_range(one, np.array([1.0, 0.5]), {PHASE.name: PHASE}) is None
