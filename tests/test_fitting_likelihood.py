"""The likelihood of samples that a sensor has rounded."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erfcx

from jaxcam import fitting
from jaxcam.fitting.engine._likelihood import score
from jaxcam.fitting.engine._scaled_erfc import scaled_erfc


def test_the_scaled_error_function():
    """To 3e-15, also where erfc is no longer a normal number."""
    at = np.concatenate(
        [[0.0], np.geomspace(1e-12, 1e12, 2001), np.linspace(26, 28, 9)]
    )
    np.testing.assert_allclose(scaled_erfc(jnp.asarray(at)), erfcx(at), rtol=3e-15)


def _rounding(resolution):
    return fitting.Sensor(0, noise=1.0, resolution=resolution)


@pytest.mark.parametrize("resolution", [1e-2, 0.5, 3.0, 40.0])
@pytest.mark.parametrize("truth", [0.0, 0.37])
def test_the_probabilities_of_all_readings_add_up_to_one(resolution, truth):
    """To 1e-11."""
    sensor = _rounding(resolution)
    count = int(12 / resolution) + 2
    readings = resolution * jnp.arange(-count, count + 1.0)
    cost = score(sensor, readings, jnp.full_like(readings, truth)).cost
    density = np.exp(-np.asarray(cost) / 2) / np.sqrt(2 * np.pi * sensor.floor**2)
    assert np.sum(density) * resolution == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize("resolution", [1e-2, 0.5, 3.0, 40.0])
def test_the_score_is_the_slope_of_the_cost_however_far_the_reading(resolution):
    """To 1e-9, from the reading itself to a million standard deviations, where the
    slope is the distance from the nearer end of the interval."""
    sensor = _rounding(resolution)
    off = jnp.concatenate(
        [jnp.geomspace(1e-3, 1e6, 300), resolution / 2 + jnp.linspace(35.0, 40.0, 200)]
    )

    def cost(predicted):
        return jnp.sum(score(sensor, off, predicted).cost)

    found = score(sensor, off, 0 * off)
    np.testing.assert_allclose(
        found.score, -jax.grad(cost)(0 * off) / 2, rtol=1e-9, atol=1e-9
    )
    far = np.asarray(off) > resolution / 2 + 30.0
    away = np.asarray(off)[far] - resolution / 2
    if resolution > 0.3:
        # Mills' ratio: the tail of a normal distribution at a falls as a + 1 / a
        np.testing.assert_allclose(
            np.asarray(found.score)[far], away + 1 / away, rtol=3 / 30**4
        )
    assert np.all(np.asarray(found.information) > 0)


@pytest.mark.parametrize("resolution", [1e-16, 1e-9, 1e-6, 1e-4, 1e-3])
def test_a_fine_resolution_has_no_effect(resolution):
    """The likelihood is that of Gaussian noise, to 1e-9 and 100 times the square of the
    resolution in standard deviations; it is finite at any distance."""
    off = jnp.asarray([0.0, 1e-12, 0.3, 4.0, 30.0])
    found, plain = (
        score(fitting.Sensor(0, noise=1.0, resolution=r), off, 0 * off)
        for r in (resolution, 0.0)
    )
    for one, other in zip(found, plain):
        np.testing.assert_allclose(
            one, other, rtol=100 * resolution**2 + 1e-9, atol=resolution**2 + 1e-10
        )
    away = jnp.geomspace(1.0, 1e14, 50)
    far = score(_rounding(resolution), away, 0 * away)
    for part in far:
        assert np.all(np.isfinite(part))
