"""Friction that acts in one direction of motion, and Coulomb friction."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks._made_rigs import made_rig
from benchmarks.named import hidden_case as named_case
from benchmarks.unnamed import hidden_case, judged
from jaxcam.discrepancy import diagnose
from jaxcam.discrepancy.search import _one_direction, one_direction
from jaxcam.discrepancy.search._named_parts import without_friction
from jaxcam.discrepancy.terms import BACKWARD, CoulombFriction, DRY, FORWARD, sum_of
from jaxcam.discrepancy.terms._primitives import CUBE, FALLING


FRICTION, KNOWN, PRIOR = 0.3, 400.0, 25.0


class _Blocks(SimpleNamespace):
    def total(self):
        return self.information, self.score

    def rows(self, names):
        return np.array([self.names.index(name) for name in names])


def _trials(monkeypatch, constant):
    """A fit whose cost is `KNOWN*(k + f - constant)**2 + PRIOR*k**2`, with a rig
    parameter `k` at its optimum, a constant force `f = 0`, and Coulomb friction.
    """
    k = KNOWN * constant / (KNOWN + PRIOR)
    information = np.array(
        [[KNOWN + PRIOR, 0.0, KNOWN], [0.0, 1e4, 0.0], [KNOWN, 0.0, KNOWN]]
    )
    score = np.array([0.0, 0.0, KNOWN * (constant - k)])
    names = ("k", "fc", "f0")
    blocks = _Blocks(
        information=information, score=score, names=names, scale=np.ones(3)
    )
    monkeypatch.setattr(_one_direction, "force_blocks", lambda *given: blocks)
    monkeypatch.setattr(_one_direction, "heat_of", lambda found: 1.0)
    response = SimpleNamespace(free=("k", "fc"), prior=np.array([PRIOR, 0.0]))
    best = SimpleNamespace(
        names=frozenset({"coulomb_friction"}),
        fit={"fc": SimpleNamespace(value=FRICTION)},
    )
    trials = SimpleNamespace(
        term=lambda name: CoulombFriction(),
        response=lambda names: response,
        problem=None,
    )
    return trials, best


@pytest.mark.parametrize(
    ("constant", "form", "expected"),
    [
        # what a rig without a constant force cannot be
        (-FRICTION, FORWARD, -1.0),
        (FRICTION, BACKWARD, -1.0),
        # half of it: both explanations are as far from the nominal rig
        (-FRICTION / 2, FORWARD, 0.0),
        (0.0, FORWARD, 1.0),
    ],
)
def test_the_cost_of_one_direction_follows_from_the_constant_force(
    monkeypatch, unchecked_types, constant, form, expected
):
    """In closed form, to rounding."""
    trials, best = _trials(monkeypatch, constant)
    found = one_direction(trials, best)
    assert found is not None
    unit = KNOWN * PRIOR / (KNOWN + PRIOR) * FRICTION**2
    assert found.worse == pytest.approx(expected * unit, abs=1e-9)
    if expected < 1:
        assert found.form is form
    assert abs(found.size) == pytest.approx(2 * FRICTION)
    assert found.hidden == "k"


def test_a_fit_without_coulomb_friction_has_no_direction(monkeypatch, unchecked_types):
    trials, best = _trials(monkeypatch, 0.0)
    best.names = frozenset({"viscous_damping"})
    assert one_direction(trials, best) is None


@pytest.mark.slow
def test_friction_in_one_direction_is_not_named_coulomb_friction():
    """The rig can represent the constant force by which they differ, but not within
    its tolerances; the size of the friction to 0.1 %."""
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
    ],
)
def test_other_sums_contain_no_coulomb_friction(parts, numbers):
    form = sum_of(parts, [1.0] * len(parts)) if len(parts) > 1 else parts[0]
    assert without_friction(form, np.array(numbers)) is None
