"""Sums of forms that resemble a function, from its likelihood alone."""

import math

import numpy as np
import pytest

from jaxcam.discrepancy.search._curve_likelihood import CurveLikelihood
from jaxcam.discrepancy.search._named_parts import without_friction
from jaxcam.discrepancy.search._sums_of_forms import SumSearch
from jaxcam.discrepancy.terms import Family, sum_of, Variable, Where


COUNT, PRICE = 21, 10.0


def _likelihood(argument, sharpness, noise=0.0, **true):
    """The likelihood of a function that is a sum of forms with the numbers in `true`,
    with information of random directions."""
    low, high = (0.0, 2 * math.pi) if argument is Variable.PHASE else (-0.4, 1.1)
    family = Family(Where.FLIGHT, argument, low, high)
    rng = np.random.default_rng(4)
    mixed = rng.normal(size=(3 * COUNT, COUNT))
    information = sharpness * mixed.T @ mixed / (3 * COUNT)
    if argument is not Variable.VELOCITY:
        # the last coefficient is the jump, which only a function of velocity has
        information[-1] = information[:, -1] = 0.0
    bare = CurveLikelihood(family, information, np.zeros(COUNT), 0.0, PRICE)
    sines = np.zeros(COUNT)
    for form in family.summands:
        for numbers in true.get(form.name.replace(" ", "_"), ()):
            sines += bare.sines_of(form, np.array([numbers]))[0]
    sines[:-1] += noise * rng.normal(size=COUNT - 1)
    slope = information @ sines
    return bare._replace(slope=slope, gain=float(sines @ slope))


def _numbers_of(start):
    """The numbers of a sum by the names of its forms, in their order; a harmonic of
    negative size has another phase."""
    own = []
    for part, numbers in start.primitive.divided(start.numbers):
        size, *others = map(float, numbers)
        if part.name.startswith("harmonic"):
            turned = math.pi if size < 0 else 0.0
            size, others = abs(size), [(others[0] + turned) % (2 * math.pi)]
        own.append((part.name, (size, *others)))
    return sorted(own)


@pytest.mark.parametrize(
    "argument, true",
    [
        (Variable.PHASE, {"harmonic_2": [(1.0, 0.4)], "harmonic_3": [(0.5, 1.9)]}),
        (
            Variable.PHASE,
            {
                "harmonic_1": [(1.0, 0.4)],
                "harmonic_2": [(0.6, 5.1)],
                "harmonic_3": [(0.5, 1.9)],
            },
        ),
        (Variable.POSITION, {"above": [(-8.0, 0.7)], "bump": [(1.0, 0.3, 0.09)]}),
        (Variable.POSITION, {"bump": [(1.0, 0.25, 0.08), (0.7, 0.7, 0.1)]}),
        # a Stribeck curve
        (Variable.VELOCITY, {"dry": [(-0.5,)], "falling": [(-0.4, 0.09)]}),
    ],
)
def test_a_sum_is_recognised(argument, true):
    """Its forms, and their parameters to 1 % of a significant change, although none of
    the numbers lies on the grid."""
    likelihood = _likelihood(argument, 1e4, **true)
    (best, *_) = SumSearch(likelihood).promising(3)
    expected = sorted(
        (name.replace("_", " "), numbers)
        for name, several in true.items()
        for numbers in several
    )
    found = _numbers_of(best)
    assert [name for name, _ in found] == [name for name, _ in expected]
    for (_, one), (_, other) in zip(found, expected):
        assert np.allclose(one, other, atol=1e-3, rtol=1e-3)
    # it explains everything but the price of its parameters
    count = sum(len(numbers) for _, numbers in expected)
    assert best.gain == pytest.approx(likelihood.gain - count * PRICE, rel=1e-6)


def test_the_gain_is_that_of_the_likelihood():
    """To 1e-9 of it, also for a sum that is not the function."""
    true = {"harmonic_1": [(1.0, 0.4)], "harmonic_3": [(0.5, 1.9)]}
    likelihood = _likelihood(Variable.PHASE, 1e3, noise=0.1, **true)
    for start in SumSearch(likelihood).promising(3):
        sines = likelihood.sines_of(start.primitive, start.numbers[None])[0]
        gain = 2 * sines @ likelihood.slope - sines @ likelihood.information @ sines
        gain -= start.primitive.count * PRICE
        assert start.gain == pytest.approx(gain, rel=1e-9)


def test_a_third_form_must_be_worth_its_parameters():
    """The best sum of noise about two harmonics consists of these two."""
    true = {"harmonic_1": [(1.0, 0.4)], "harmonic_3": [(0.5, 1.9)]}
    likelihood = _likelihood(Variable.PHASE, 1e4, noise=0.01, **true)
    best = SumSearch(likelihood).promising(3)[0]
    assert sorted(one.name for one in best.primitive.parts) == [
        "harmonic 1",
        "harmonic 3",
    ]


def test_forms_that_point_against_the_motion_are_not_added_to_others():
    likelihood = _likelihood(Variable.VELOCITY, 1e3, noise=1.0)
    for start in SumSearch(likelihood).promising(3):
        assert len({part.odd for part in start.primitive.parts}) == 1


def test_a_sum_is_within_the_range_if_its_parts_are():
    forms = {
        one.name: one for one in _likelihood(Variable.POSITION, 1.0).family.primitives
    }
    both = sum_of((forms["above"], forms["window"]), (1.0, 2.0))
    assert both.count == 5 and both.sharp and both.name == "above + window"
    assert both.scales == (0.05, 2.0, 0.05, 0.05)
    assert both.within([1.0, 0.3, 2.0, 0.4, 0.6])
    assert not both.within([1.0, 1.3, 2.0, 0.4, 0.6])
    assert not both.within([1.0, 0.3, 2.0, 0.6, 0.4])


def test_a_function_that_the_data_do_not_determine_has_no_sum():
    likelihood = _likelihood(Variable.PHASE, 0.0)
    assert SumSearch(likelihood).promising(3) == []


def test_a_part_that_hardly_counts_is_left_out():
    """It has 0.04 % of the gain of the other, although it is significant."""
    true = {"harmonic_1": [(1.0, 0.4)], "harmonic_3": [(0.02, 1.9)]}
    likelihood = _likelihood(Variable.PHASE, 1e6, **true)
    (every, *_) = SumSearch(likelihood).promising(1)
    assert {"harmonic 1", "harmonic 3"} <= {one.name for one in every.primitive.parts}
    for start in SumSearch(likelihood, 0.15**2).promising(3):
        sizes = [own[0] for _, own in start.primitive.divided(start.numbers)]
        assert min(map(abs, sizes)) > 0.05


@pytest.mark.parametrize("true", [{"forward": -0.4}, {"backward": 0.4}])
def test_friction_that_differs_in_the_two_directions_is_recognised(true):
    """Coulomb friction and a force in one direction that opposes the motion, each to
    1e-9."""
    ((name, size),) = true.items()
    likelihood = _likelihood(Variable.VELOCITY, 1e4, dry=[(-0.5,)], **{name: [(size,)]})
    best, *_ = SumSearch(likelihood).with_friction(3)
    split = without_friction(*best)
    assert split is not None
    friction, form, numbers = split
    assert form.name == name
    np.testing.assert_allclose([friction, *numbers], [0.5, size], rtol=1e-9)
