"""A second term that the smoothed corner of dry friction explains is not named."""

import types

import pytest

from jaxcam.discrepancy import library, Policy
from jaxcam.discrepancy.evidence._masked import unmasked


class Costs:
    """Trials of which only the costs are known."""

    def __init__(self, costs, policy):
        self.policy = policy
        self.terms = {term.name: term for term in library()}
        self.known = {
            names: types.SimpleNamespace(
                names=names, fit=types.SimpleNamespace(cost=cost)
            )
            for names, cost in costs.items()
        }

    def term(self, name):
        return self.terms[name]

    def without(self, best, name):
        return self.known[best.names - {name}]


def _asked(first: str, second: str, lost: float, policy=Policy()):
    """`first` explains a million; without `second` the cost grows by `lost`."""
    costs = {
        frozenset(): 1e6 + 50.0,
        frozenset({first}): 50.0 + lost,
        frozenset({second}): 9e5,
        frozenset({first, second}): 50.0,
    }
    trials = Costs(costs, policy)
    best = trials.known[frozenset({first, second})]
    found, dropped = unmasked(trials, best)  # pyright: ignore
    return set(found.names), dropped


pytestmark = pytest.mark.usefixtures("unchecked_types")


def test_what_a_corner_leaves_over_is_not_named():
    names, dropped = _asked("coulomb_friction", "external_vibration", 100.0)
    assert names == {"coulomb_friction"}
    ((name, share),) = dropped
    assert name == "external_vibration"
    assert share == pytest.approx(1e-4)


@pytest.mark.parametrize(
    ("first", "lost"),
    [("coulomb_friction", 1e3), ("nonlinear_spring", 100.0)],
)
def test_more_than_that_and_what_has_no_corner_stays(first, lost):
    names, dropped = _asked(first, "external_vibration", lost)
    assert names == {first, "external_vibration"} and not dropped


def test_the_share_is_a_number_of_the_policy():
    policy = Policy(corner_share=1e-5)
    names, _ = _asked("coulomb_friction", "external_vibration", 100.0, policy)
    assert len(names) == 2
