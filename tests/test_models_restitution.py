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


# Table 5.2 as printed: speed (rpm) and two multipliers of the orbit P(1,1)
TABLE_5_2 = [
    (135.946698873817, 0.212856564951, 0.996008664393),
    (135.946850039257, 0.214199564174, 0.989769009976),
    (135.947353924057, 0.216351137284, 0.979943000383),
    (135.949033540057, 0.220281698370, 0.962513414400),
    (135.951832900057, 0.224549930832, 0.944309362903),
    (
        147.941373499943,
        -0.467436119698 - 0.300839993821j,
        -0.467436119698 + 0.300839993821j,
    ),
    (
        148.962048199932,
        -0.521622451717 - 0.214489798539j,
        -0.521622451717 + 0.214489798539j,
    ),
    (150.186857839919, -0.467765740979, -0.703735852712),
    (151.656629407902, -0.353243069838, -0.970265166132),
    (153.420355289483, -0.297944998464, -1.206154145399),
]


def test_units_are_inverse_and_a_turn_a_second_is_sixty_rpm():
    assert abs(rpm_to_rad_s(60.0) - 2 * np.pi) < 1e-15 * 2 * np.pi
    speeds = np.array([1.0, 122.5, 188.0])
    assert np.max(np.abs(rad_s_to_rpm(rpm_to_rad_s(speeds)) - speeds)) < 1e-13


def test_linear_law_is_the_one_behind_table_5_2():
    law = LinearInSpeed()
    for speed, first, second in TABLE_5_2:
        r = np.sqrt(np.real(first * second))
        # dimensionless; the defaults carry eight decimals
        assert abs(law(rpm_to_rad_s(speed), 0.1) - r) < 6e-7


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
