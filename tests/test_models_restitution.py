"""Laws of restitution against the numbers and formulas that define them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.models import (
    ConstantRestitution,
    LinearInSpeed,
    PowerLawRestitution,
    rad_s_to_rpm,
    rpm_to_rad_s,
)
from jaxcam.thesis.chapter_5_bifurcations.table_5_2 import PRODUCTS, SPEEDS


def test_units_are_inverse_and_a_turn_a_second_is_sixty_rpm():
    assert abs(rpm_to_rad_s(60.0) - 2 * np.pi) < 1e-15 * 2 * np.pi
    speeds = np.array([1.0, 122.5, 188.0])
    assert np.max(np.abs(rad_s_to_rpm(rpm_to_rad_s(speeds)) - speeds)) < 1e-13


def test_linear_law_is_the_one_behind_table_5_2():
    law = LinearInSpeed()
    for speed, product in zip(SPEEDS, PRODUCTS, strict=True):
        # dimensionless; the defaults carry eight decimals
        assert abs(law(rpm_to_rad_s(speed), 0.1) - np.sqrt(product)) < 6e-7


def test_linear_law_stays_between_zero_and_one():
    law = LinearInSpeed()
    assert law(rpm_to_rad_s(50.0), 0.1) == 0.0
    assert law(rpm_to_rad_s(250.0), 0.1) == 1.0
    slope = jax.grad(law)(rpm_to_rad_s(145.0), 0.1)
    assert abs(slope - law.slope) < 1e-17


def test_power_law():
    law = PowerLawRestitution(r0=0.55, reference_speed=0.3, exponent=0.2)
    speeds = np.array([0.0, 1e-9, 0.3, 2.0])
    expected = 0.55 * (1 + speeds / 0.3) ** -0.2
    assert np.max(np.abs(law(15.0, jnp.asarray(speeds)) - expected)) < 1e-15
    # s/rad, at rest: -r0 b / v_ref
    assert abs(jax.grad(law, argnums=1)(15.0, 0.0) + 0.55 * 0.2 / 0.3) < 1e-15


@pytest.mark.parametrize("value", [0, 0.5, 1, np.float32(0.25)])
def test_constant_law(value):
    assert float(ConstantRestitution(value)(15.0, 3.0)) == float(value)
