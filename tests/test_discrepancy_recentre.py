"""A stiffness about another centre is one function instead of two."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from swing_rig import PARAMETERS, swinging

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search import _recentre
from jaxcam.discrepancy.search._free_fits import FreeFits, Subset
from jaxcam.discrepancy.search._recentre import _moved, recentred
from jaxcam.discrepancy.search._roughness import Roughness
from jaxcam.discrepancy.search._slots import Free, roomy
from jaxcam.discrepancy.terms import (
    Factor,
    Family,
    free_basis,
    Variable,
    Where,
)


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


def test_other_functions_are_not_fitted_again(unchecked_types):
    """A force by the phase."""
    found = SimpleNamespace(functions=(FORCE,))
    assert recentred(None, found) is found  # pyright: ignore


def test_the_centre_of_a_stiffness_alone_follows_from_the_residual():
    """A stiffness 6 (v/v0)^2 about 0.05 rad, fitted about -0.04 rad: the centre to
    0.002 rad, the cost to that of noise."""
    noise, centre, fastest = 1e-4, 0.05, 2.5
    family = Family(
        Where.FLIGHT, Variable.VELOCITY, -3.5, 3.5, Factor.DEFLECTION, middle=-0.04
    )

    def force(x, v):
        return -6.0 * (v / fastest) ** 2 * (x - centre)

    problem = swinging(force, (0.2, 0.25), 1.2, noise)
    room = roomy(problem, family, (), None)
    names = [one.name for one in PARAMETERS]
    fits = FreeFits(names, (), Policy())
    one = Free(family, Roughness(6.0, 0.4), "force_a")
    about_middle = fits.fitted(Subset(room, (one,), frozenset()), room.start)
    found = recentred(fits, about_middle)
    (moved,) = found.functions
    assert moved.family.middle == pytest.approx(centre, abs=0.002)
    assert about_middle.fit.cost > 1.1 * room.samples > found.fit.cost
    # already there: nothing more to gain
    assert recentred(fits, found) is found


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
