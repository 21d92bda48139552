"""Which single forms resemble a function, from its likelihood alone."""

import numpy as np
import pytest

from jaxcam.discrepancy.search._curve_likelihood import CurveLikelihood, promising
from jaxcam.discrepancy.terms import Family, free_basis, Variable, Where


COUNT, PRICE = 21, 10.0
FASTEST = 0.98
SLOW, FAST = np.linspace(0.43, 0.97, 30), np.full(17, FASTEST)


def _likelihood(name, numbers, error):
    """The likelihood of a function of the approach speed, which 47 impacts determine
    with a given standard error each, apart from a constant that the rig represents;
    many of them are equally fast."""
    family = Family(Where.IMPACT, Variable.APPROACH, 0.0, FASTEST)
    seen = np.asarray(free_basis(family, np.concatenate([SLOW, FAST]), COUNT)) / error
    seen = seen - seen.mean(axis=0)
    information = seen.T @ seen
    bare = CurveLikelihood(family, information, np.zeros(COUNT), 0.0, PRICE)
    form = next(one for one in family.primitives if one.name == name)
    sines = bare.sines_of(form, np.array([numbers]))[0]
    slope = information @ sines
    return bare._replace(slope=slope, gain=float(sines @ slope))


@pytest.mark.parametrize(
    "name, numbers",
    [
        ("bump", (-0.13, 0.413, 0.11)),
        ("bump", (-0.13, 0.47, 0.13)),
        ("saturating", (0.1, 0.557, 0.13)),
        ("exponential", (-0.1, 2.7)),
    ],
)
def test_the_form_of_a_precisely_known_function_comes_first(name, numbers):
    """None of the parameters is a starting value, and at the impacts other forms are
    closer to the function than the form at its nearest starting values is. The
    parameters are found to 1e-3, far less than the steps between starting values."""
    best, *_ = promising(_likelihood(name, numbers, 1e-5), 3)
    assert best.primitive.name == name
    assert np.allclose(best.numbers, numbers, atol=1e-3, rtol=1e-3)


def test_the_gain_is_that_of_the_likelihood():
    """To 1e-6 of it, for each of the forms."""
    likelihood = _likelihood("bump", (-0.13, 0.413, 0.11), 1e-3)
    for start in promising(likelihood, 20):
        sines = likelihood.sines_of(start.primitive, start.numbers[None])[0]
        gain = 2 * sines @ likelihood.slope - sines @ likelihood.information @ sines
        gain -= start.primitive.count * PRICE
        assert start.gain == pytest.approx(gain, rel=1e-6, abs=1e-6 * likelihood.gain)
        assert start.primitive.within(start.numbers)
