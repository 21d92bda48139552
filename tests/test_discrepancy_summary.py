"""Sentences and numbers of a report about the parameters of a rig."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxcam.discrepancy.policy import Policy
from jaxcam.discrepancy.report._summary import _moved
from jaxcam.discrepancy.report._write import _pulls, _rig_values
from jaxcam.fitting import Parameter
from jaxcam.fitting._fit_result import Estimate


# the fits are stand-ins
pytestmark = pytest.mark.usefixtures("unchecked_types")


class Fitted(dict):
    """Estimates by label, as a fit gives them."""

    def __init__(self, *estimates: Estimate, tolerance: float = 0.3):
        super().__init__({one.label: one for one in estimates})
        self.estimates = estimates
        names = tuple(dict.fromkeys(one.name for one in estimates))
        known = {
            name: Parameter(name, lambda m: m, tolerance, nominal=0.8) for name in names
        }
        self.problem = SimpleNamespace(
            parameter=known.get,
            names=names,
            parameters=tuple(known[name] for name in names),
            # where a fit begins is not the nominal value
            start=SimpleNamespace(values=np.full((2, len(names)), 2.0)),
        )


@pytest.mark.parametrize(
    ("value", "said"), [(1.1, "to 1.1, the limit of its tolerance."), (1.0, "to 1.")]
)
def test_a_value_at_the_limit_of_its_tolerance_is_said(value, said):
    """Without the effect, no value beyond the tolerance was allowed."""
    best = SimpleNamespace(
        names={"coulomb_friction"}, fit=Fitted(Estimate("damping", 0.746, 0.003))
    )
    within = Fitted(Estimate("damping", value, 0.003))
    sentence = _moved(best, within, ["damping"], Policy())  # pyright: ignore
    assert sentence.endswith(f"shifted damping from 0.746 {said}")


def test_values_that_differ_between_recordings_are_all_reported():
    question = SimpleNamespace(rig=("phase",), shown={}, fitted_speed=None)
    rows = [Estimate("phase", v, 0.01, "rad", r) for v, r in ((0.5, "a"), (1.1, "b"))]
    fitted = Fitted(*rows)
    question.problem = fitted.problem
    found = _rig_values(question, fitted, {})  # pyright: ignore
    assert {name: one.value for name, one in found.items()} == {
        "phase@a": 0.5,
        "phase@b": 1.1,
    }
    pulls = _pulls(question, fitted, fitted)  # pyright: ignore
    assert pulls["phase@b"] == pytest.approx((1.0, 1.0))


@pytest.mark.parametrize(("scatter", "error"), [(0.05, 0.05), (0.4, 0.3 / 3**0.5)])
def test_the_scatter_of_bootstrap_samples_does_not_exceed_the_prior(scatter, error):
    """A tolerance of 0.3 has the standard deviation 0.3 / sqrt(3)."""
    question = SimpleNamespace(rig=("tilt",), shown={}, fitted_speed=None)
    fitted = Fitted(Estimate("tilt", 0.5, 0.01))
    found = _rig_values(question, fitted, {"tilt": scatter})  # pyright: ignore
    assert found["tilt"].stderr == pytest.approx(error)
