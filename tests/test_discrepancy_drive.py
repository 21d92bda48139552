"""Ripple of a drive against drives that wander only."""

import numpy as np
import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence import Ripple, ripple_of
from jaxcam.recordings import Recording


_TIME = 5e-4 * np.arange(8000)
_NOISE = 1.35e-4


def _drives(eps, psi, rng):
    """Six drives with slow wandering, integrated by small steps."""
    found = []
    for number, rpm in enumerate((130, 140, 147, 155, 163, 175)):
        rate = rpm * np.pi / 30
        shift = rng.uniform(0, 2 * np.pi, 2)
        wander = 1 + 2e-4 * (
            0.7 * np.cos(2 * np.pi * 0.31 * _TIME + shift[0])
            + 0.3 * np.cos(2 * np.pi * 1.4 * _TIME + shift[1])
        )
        angle = np.zeros(len(_TIME))
        # midpoint rule, whose error over a step is far below the noise
        for k in range(len(_TIME) - 1):
            h = _TIME[k + 1] - _TIME[k]
            w = rate * (wander[k] + wander[k + 1]) / 2
            middle = angle[k] + h / 2 * w * (1 + eps * np.cos(angle[k] - psi))
            angle[k + 1] = angle[k] + h * w * (1 + eps * np.cos(middle - psi))
        noisy = angle + _NOISE * rng.standard_normal(len(angle))
        found.append(Recording(f"run{number}", _TIME, {"cam_angle_rad": noisy}))
    return found


def test_a_ripple_is_measured():
    eps, psi = 1e-4, 2.1
    found = ripple_of(_drives(eps, psi, np.random.default_rng(3)), _NOISE)
    assert found.eps == pytest.approx(eps, abs=4 * found.eps_stderr)
    assert found.psi == pytest.approx(psi, abs=4 * found.psi_stderr)
    assert found.delta_bic < -1000
    assert found.inclusion == 1.0
    assert type(found.psi_stderr) is float


def test_wandering_is_no_ripple():
    found = ripple_of(_drives(0.0, 0.0, np.random.default_rng(4)), _NOISE)
    assert found.delta_bic > 0
    assert found.p_value > 1e-3
    assert found.eps < 4 * found.eps_stderr


def test_a_ripple_that_half_of_the_redrawn_sets_lack_is_none():
    """As any other term, it must be kept by `Policy.confidence` of them."""
    policy = Policy()
    known = dict.fromkeys(
        ("eps", "eps_stderr", "psi", "psi_stderr", "p_value", "dispersion"), 1e-6
    )
    for inclusion, named in ((0.5, False), (policy.confidence, True)):
        ripple = Ripple(
            **known,
            gain=23.3,
            count=48000,
            per_record={},
            heldout_gain=1.0,
            inclusion=inclusion,
        )
        assert ripple.significant(13, policy) is named
