"""A stiffness about another centre is one function instead of two."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from jaxcam.discrepancy.search import _recentre
from jaxcam.discrepancy.search._recentre import _moved, recentred
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._slots import Free
from jaxcam.discrepancy.terms import Factor, Family, free_basis, Variable, Where


FAMILY = Family(Where.FLIGHT, Variable.PHASE, 0.0, 2 * math.pi, middle=0.4)
STIFFNESS = Free(
    dataclasses.replace(FAMILY, factor=Factor.DEFLECTION), Roughness(), "force_a"
)
FORCE = Free(FAMILY, Roughness(), "force_b")


def _found(stiffness, force, score=100.0):
    """A fit of a stiffness and a force, given as functions of the phase."""
    along = np.linspace(0.0, 2 * math.pi, 200)
    values = {}
    for one, function in ((STIFFNESS, stiffness), (FORCE, force)):
        basis = free_basis(one.family, along, len(one.coefficients))
        numbers = np.linalg.lstsq(basis, function(along))[0]
        values |= dict(zip(one.coefficients, numbers))
    fit = {name: SimpleNamespace(value=value) for name, value in values.items()}
    return SimpleNamespace(
        functions=(STIFFNESS, FORCE), fit=fit, score=score, names=frozenset()
    )


@pytest.mark.parametrize("centre", [0.1, 0.4, 0.9])
def test_the_centre_follows_from_the_two_curves(centre, unchecked_types):
    """g (q - c) = g (q - 0.4) + (0.4 - c) g: to 1e-9."""

    def g(a):
        return 0.3 * np.cos(2 * a - 1.0) + 0.1

    found = _found(g, lambda a: (0.4 - centre) * g(a))
    moved = _moved(found, STIFFNESS, FORCE)  # pyright: ignore
    assert moved.family.middle == pytest.approx(centre, abs=1e-9)
    assert moved.slot == STIFFNESS.slot


def test_functions_without_a_partner_are_not_fitted_again(unchecked_types):
    """A stiffness by the phase, and a force by the time."""
    other = dataclasses.replace(
        FORCE, family=dataclasses.replace(FAMILY, argument=Variable.TIME)
    )
    found = SimpleNamespace(functions=(STIFFNESS, other))
    assert recentred(None, found) is found  # pyright: ignore


@pytest.mark.parametrize(("score", "functions"), [(90.0, 1), (110.0, 2)])
def test_the_two_stay_if_they_have_more_evidence(
    score, functions, monkeypatch, unchecked_types
):
    def g(a):
        return 0.3 * np.cos(2 * a - 1.0)

    found = _found(g, lambda a: 0.2 * g(a))
    point = SimpleNamespace(values=np.zeros((1, 1)))
    point._replace = lambda values: point

    class Fit(dict):
        pass

    def fitted(subset, start):
        made = Fit(found.fit)
        made.point = point
        number = len(subset.functions)
        return SimpleNamespace(
            functions=subset.functions,
            fit=made,
            score=score if number == 1 else 105.0,
            names=frozenset(),
        )

    monkeypatch.setattr(_recentre, "emptied", lambda *args: None)
    first = Fit(found.fit)
    first.point = point
    found.fit, found.problem = first, None
    chosen = recentred(SimpleNamespace(fitted=fitted), found)  # pyright: ignore
    assert len(chosen.functions) == functions
    if functions == 1:
        (left,) = chosen.functions
        assert left.slot == STIFFNESS.slot
        assert left.family.middle < STIFFNESS.family.middle
