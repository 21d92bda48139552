"""Friction that acts in one direction of motion, and Coulomb friction."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize

from benchmarks._made_rigs import made_rig
from benchmarks.named import hidden_case as named_case
from benchmarks.unnamed import hidden_case, judged
from jaxcam.discrepancy import diagnose, Policy
from jaxcam.discrepancy.report._direction import in_both_directions, in_one_direction
from jaxcam.discrepancy.search import _one_direction, one_direction, OneDirection
from jaxcam.discrepancy.search._named_parts import friction_named, without_friction
from jaxcam.discrepancy.terms import (
    BACKWARD,
    CoulombFriction,
    DRY,
    Family,
    FORWARD,
    sum_of,
    Variable,
    Where,
)
from jaxcam.discrepancy.terms._primitives import CUBE, FALLING


FRICTION, KNOWN, PRIOR = 0.3, 400.0, 25.0


class _Blocks(SimpleNamespace):
    def total(self):
        return self.information, self.score

    def rows(self, names):
        return np.array([self.names.index(name) for name in names])


# information of the friction, and of the friction with a constant force
OWN, SHARED = 900.0, 150.0


def _cost(constant, k, f, friction):
    """What a rig parameter `k`, a constant force and friction leave, with a prior."""
    force, rubs = k + f - constant, friction - FRICTION
    left = KNOWN * force**2 + OWN * rubs**2 + 2 * SHARED * force * rubs
    return left + PRIOR * k**2


def _least(constant, sense):
    """The least cost with a constant force `sense` times as large as the friction."""
    found = minimize(
        lambda x: _cost(constant, x[0], sense * x[1], x[1]), [0.0, FRICTION], tol=1e-14
    )
    return found.fun


def _trials(monkeypatch, constant):
    """A fit without a constant force, at its optimum."""
    information = np.array(
        [
            [KNOWN + PRIOR, SHARED, KNOWN],
            [SHARED, OWN, SHARED],
            [KNOWN, SHARED, KNOWN],
        ]
    )
    k, rubs = np.linalg.solve(
        information[:2, :2], [KNOWN * constant, SHARED * constant]
    )
    off = np.array([k - constant, rubs])
    score = np.array([0.0, 0.0, -(KNOWN * off[0] + SHARED * off[1])])
    blocks = _Blocks(
        information=information,
        score=score,
        names=("k", "fc", "f0"),
        scale=np.ones(3),
    )
    monkeypatch.setattr(_one_direction, "force_blocks", lambda *given: blocks)
    monkeypatch.setattr(_one_direction, "heat_of", lambda found: 1.0)
    response = SimpleNamespace(
        free=("k", "fc"), prior=np.array([PRIOR, 0.0]), pull=np.array([-PRIOR * k, 0.0])
    )
    best = SimpleNamespace(
        names=frozenset({"coulomb_friction"}),
        fit={"fc": SimpleNamespace(value=FRICTION + rubs)},
    )
    trials = SimpleNamespace(
        terms=(CoulombFriction(),), response=lambda names: response, problem=None
    )
    before = _cost(constant, k, 0.0, FRICTION + rubs)
    return trials, best, before


@pytest.mark.parametrize("constant", [-FRICTION, FRICTION, -FRICTION / 2, 0.0])
def test_the_change_in_cost_is_that_of_a_constant_force_as_large_as_the_friction(
    monkeypatch, unchecked_types, constant
):
    """The more likely direction, compared with a minimisation of the cost, to 1e-6."""
    trials, best, before = _trials(monkeypatch, constant)
    found = one_direction(trials, best)
    assert found is not None
    least = {-1.0: _least(constant, -1.0), 1.0: _least(constant, 1.0)}
    sense = min(least, key=lambda one: least[one])
    assert found.worse == pytest.approx(least[sense] - before, abs=1e-6)
    if constant:
        assert found.form is (FORWARD if constant < 0 else BACKWARD)
        assert np.sign(found.size) == np.sign(constant)
    assert found.hidden == "k"


def test_one_direction_is_preferred_only_if_that_is_seldom_wrong():
    """With Coulomb friction and the least favourable accuracy of a constant force, in
    at most 10 % of the cases (to 0.5 %); one of the directions is always the better."""
    policy, rng = Policy(), np.random.default_rng(3)
    limit = max(
        one
        for one in np.linspace(-5, 0, 5001).tolist()
        if OneDirection(FORWARD, -1.0, one, "k").preferred(policy)
    )
    wrong = []
    for ratio in (0.3, 1.0, 1.64, 2.0, 4.0):
        worse = ratio**2 - 2 * ratio * np.abs(rng.standard_normal(40_000))
        wrong.append(np.mean(worse < limit))
    assert max(wrong) == pytest.approx(1 - policy.confidence, abs=5e-3)


def test_a_fit_without_coulomb_friction_has_no_direction(monkeypatch, unchecked_types):
    """Or with a constant force, which the fit then contains already, or if the friction
    acts on another coordinate."""
    trials, best, _ = _trials(monkeypatch, 0.0)
    best.names = frozenset({"coulomb_friction", "constant_force"})
    assert one_direction(trials, best) is None
    best.names = frozenset({"viscous_damping"})
    assert one_direction(trials, best) is None
    best.names = frozenset({"coulomb_friction"})
    trials.terms = (CoulombFriction(coordinate=1),)
    assert one_direction(trials, best) is None


@pytest.mark.slow
def test_friction_in_one_direction_is_not_named_coulomb_friction():
    """The rig can represent the constant force by which they differ, but not within
    its tolerances; the size of the friction to 0.1 %."""
    pytest.importorskip("numba")
    rig = made_rig("cam_follower")
    hidden, runs, motions, _ = hidden_case(rig, "one_way", 4801)
    found = diagnose(rig.given, runs)
    right, why = judged(found, hidden, motions)
    assert right, why
    (one,) = found.missing
    assert one.formula is not None
    size = float(one.formula.split("*")[0])
    assert size == pytest.approx(-hidden.unit, rel=1e-3)


@pytest.mark.slow
def test_coulomb_friction_is_not_explained_by_one_direction():
    pytest.importorskip("numba")
    rig = made_rig("cam_follower")
    _, _, runs, _ = named_case(rig, "coulomb_friction", None, 4801)
    found = diagnose(rig.given, runs)
    assert [one.name for one in found.effects] == ["coulomb_friction"]


@pytest.mark.parametrize(
    ("parts", "numbers", "friction", "form", "left"),
    [
        # friction of 0.5 in one direction and 0.2 in the other
        ((FORWARD, BACKWARD), (-0.5, 0.2), 0.2, "forward", (-0.3,)),
        ((BACKWARD, FORWARD), (0.5, -0.2), 0.2, "backward", (0.3,)),
        ((DRY, FALLING), (-0.4, -0.1, 0.2), 0.4, "falling", (-0.1, 0.2)),
    ],
)
def test_coulomb_friction_is_taken_from_a_sum(parts, numbers, friction, form, left):
    found = without_friction(sum_of(parts, [1.0] * len(parts)), np.array(numbers))
    assert found is not None
    assert found[0] == pytest.approx(friction)
    assert found[1].name == form
    np.testing.assert_allclose(found[2], left)


@pytest.mark.parametrize(
    ("parts", "numbers"),
    [
        # a force that pushes in both directions is no friction
        ((FORWARD, BACKWARD), (0.5, -0.2)),
        ((FORWARD, BACKWARD), (-0.5, -0.2)),
        ((FORWARD, CUBE), (-0.5, 1.0)),
        ((FORWARD,), (-0.5,)),
        # friction alone has no other form
        ((FORWARD, BACKWARD), (-0.5, 0.5)),
    ],
)
def test_other_sums_contain_no_coulomb_friction(parts, numbers):
    form = sum_of(parts, [1.0] * len(parts)) if len(parts) > 1 else parts[0]
    assert without_friction(form, np.array(numbers)) is None


def test_friction_is_named_only_beside_a_force_by_velocity_in_flight(unchecked_types):
    family = Family(Where.FLIGHT, Variable.VELOCITY, -1.0, 1.0)
    fits = SimpleNamespace(terms=(CoulombFriction(),))
    found = SimpleNamespace(names=frozenset())

    def named(family, fits=fits, found=found):
        one = SimpleNamespace(family=family, gate=None)
        return friction_named(fits, found, one)  # pyright: ignore

    assert named(family)
    assert not named(dataclasses.replace(family, where=Where.SENSOR))
    assert not named(dataclasses.replace(family, argument=Variable.POSITION))
    assert not named(family, fits=SimpleNamespace(terms=()))
    there = SimpleNamespace(names=frozenset({"coulomb_friction"}))
    assert not named(family, found=there)


@pytest.mark.parametrize(("size", "when"), [(-0.6, "positive"), (0.6, "negative")])
def test_the_caveat_states_the_direction_and_what_to_measure(size, when):
    form = FORWARD if size < 0 else BACKWARD
    direction = OneDirection(form, size, 1.0, "spring_elongation")
    caveats = in_one_direction(direction), in_both_directions(direction)
    assert f"only at {when} velocities" in caveats[0].sentence
    assert "Coulomb friction of half the size" in caveats[1].sentence
    for caveat in caveats:
        assert "measure spring elongation more accurately" in caveat.sentence
