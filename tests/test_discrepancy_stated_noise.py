"""Caveats about a stated noise that the residuals contradict."""

from types import SimpleNamespace

import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.report import _stated_noise


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(
    "rms, errors, said",
    [
        ((0.4, 0.5), (), True),  # rms of both recordings: 0.453
        ((0.4, 0.6), (), False),  # 0.510
        # the noise was increased to allow for errors of the model
        ((0.1, 0.1), ("errors",), False),
    ],
)
def test_a_residual_below_half_the_noise(rms, errors, said, monkeypatch):
    """The caveat gives the residual, which may be stated as the noise."""
    parts = [
        SimpleNamespace(channel="height_m", noise=1.0, rms=one, value=[one])
        for one in rms
    ]
    # a recording without samples in flight or contact
    parts.append(SimpleNamespace(channel="height_m", noise=1.0, value=[]))
    monkeypatch.setattr(_stated_noise, "residuals", lambda found: parts)
    sensors = SimpleNamespace(sensors={"height_m": None})
    found = SimpleNamespace(problem=SimpleNamespace(model=sensors))
    question = SimpleNamespace(model_errors=errors)
    given = question, found, Policy()
    caveats = list(_stated_noise.quieter_than_stated(*given))  # pyright: ignore
    assert [one.reason for one in caveats] == ["quieter than stated"] * said
    assert all("is 0.453, only 0.45 times" in one.sentence for one in caveats)
