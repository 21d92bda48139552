"""The rig behind the thesis' numbers, and the tables computed from it."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from jaxcam.hybrid import flow
from jaxcam.hybrid.surface import release_point
from jaxcam.models import preset, rad_s_to_rpm, rpm_to_rad_s
from jaxcam.thesis import reproduce
from jaxcam.thesis.make_calibrated import fit_rig, free, Observed, restitution_law
from jaxcam.thesis.speeds import at_rpm


@pytest.fixture(scope="module")
def calibrated():
    return preset("calibrated")


@pytest.fixture(scope="module")
def multipliers(calibrated):
    return reproduce("table-5.2", calibrated).set_index("quantity")


def test_table_4_4_is_the_default():
    assert (
        np.max(np.abs(reproduce("table-4.4", preset("table-4.4"))["difference"])) == 0
    )


def test_restitution_lies_on_a_line():
    """Products of multipliers are squares of r; the line leaves less than 3e-12."""
    law = restitution_law()
    assert np.max(np.abs(law.residuals)) < 3e-12
    assert_allclose(law.law.slope, preset("calibrated").restitution.slope, rtol=1e-12)


def test_sums_and_products_of_multipliers(multipliers):
    """Sums to 2e-4 at 147.9 to 153.4 rpm; products as flight is conservative."""
    sums = multipliers.filter(like="sum at", axis=0)["difference"]
    products = multipliers.filter(like="product at", axis=0)["difference"]
    assert len(sums) == len(products) == 5
    assert np.max(np.abs(sums)) < 2e-4
    assert np.max(np.abs(products)) < 1e-11


def test_fold_and_flip_come_out_without_having_been_fitted(multipliers):
    speeds = multipliers.filter(like="add up", axis=0)["difference"]
    assert len(speeds) == 5
    assert np.max(np.abs(speeds)) < 0.01
    assert abs(multipliers.loc["fold", "computed"] - 135.947) < 0.01
    assert 151.8 < multipliers.loc["first flip", "computed"] < 151.9


def test_multipliers_by_another_integrator(calibrated, multipliers):
    """Stroboscopic map with DOP853 and its own event, differenced numerically."""
    rpm = 147.941373499943
    speed = float(rpm_to_rad_s(rpm))
    period = 60 / rpm
    cam = calibrated.profile
    e, h = float(cam.eccentricity), float(cam.radius + cam.half_height)
    x0, y0 = float(cam.center_x), float(cam.center_y)
    k = float(calibrated.stiffness / calibrated.inertia)
    xa, length = float(calibrated.spring_hook_x), float(calibrated.spring_elongation)
    d, phase = float(calibrated.spring_half_height), float(calibrated.phase)
    r = float(calibrated.restitution(jnp.asarray(speed), jnp.asarray(0.0)))

    def contact(t):
        angle = -(speed * t + phase)
        x, y = e * np.cos(angle) + x0, e * np.sin(angle) + y0
        return np.arcsin(h / np.hypot(x, y)) + np.arctan2(y, x)

    def velocity(t, step=1e-5):
        near = contact(t + step) - contact(t - step)
        far = contact(t + 2 * step) - contact(t - 2 * step)
        return (8 * near - far) / (12 * step)

    def field(t, s):
        stretch = xa * np.tan(s[0]) + d / np.cos(s[0]) - length
        return [s[1], -k * stretch * (xa + d * np.sin(s[0])) / np.cos(s[0]) ** 2]

    def hit(t, s):
        return s[0] - contact(t)

    hit.terminal, hit.direction = True, -1  # pyright: ignore

    def turn(state):
        begin, end = 0.3 * period, 1.3 * period
        first = solve_ivp(
            field,
            (begin, end),
            state,
            method="DOP853",
            events=hit,
            rtol=1e-12,
            atol=1e-13,
        )
        t, (angle, before) = first.t[-1], first.y[:, -1]
        after = before - (1 + r) * (before - velocity(t))
        rest = solve_ivp(
            field, (t, end), [angle, after], method="DOP853", rtol=1e-12, atol=1e-13
        )
        return rest.y[:, -1]

    name = f"multipliers at {rpm:.6f} rpm, "
    real = multipliers.loc[name + "real part", "computed"]
    imaginary = multipliers.loc[name + "imaginary part", "computed"]
    # the impact is near -0.0456 s, with 2.37 rad/s after it
    fly = solve_ivp(
        field,
        (-0.0456, 0.3 * period),
        [contact(-0.0456), 2.3694],
        method="DOP853",
        rtol=1e-10,
    ).y[:, -1]
    fixed = fsolve(lambda s: turn(s) - s, fly, xtol=1e-12)
    step = 1e-5
    columns = [
        (turn(fixed + step * unit) - turn(fixed - step * unit)) / (2 * step)
        for unit in np.eye(2)
    ]
    matrix = np.stack(columns, axis=1)
    assert_allclose(np.trace(matrix), 2 * real, atol=2e-6)
    assert_allclose(np.linalg.det(matrix), real**2 + imaginary**2, atol=2e-6)


@eqx.filter_jit
def _lasts(system, rpm):
    """Whether the follower is in contact again one turn after its release."""
    moved = at_rpm(system, rpm)
    start = release_point(moved, 0.0)
    end = start.time + (1 - 1e-10) * moved.period
    arrival = flow(moved, start.state, start.time, end)
    return arrival.contact[0], arrival.code


@pytest.mark.slow
def test_preset_is_what_the_fit_finds(calibrated):
    """Refit from Table 4.4: same parameters, Table 6.1 to 1.1e-5, other sense not."""
    fit = fit_rig()
    assert fit.converged
    numbers = fit.numbers()
    assert np.max(np.abs(numbers["computed"] - numbers["printed"])) < 1.1e-5
    preset_values = [float(v) for v in free(Observed(calibrated, jnp.asarray(0.0)))]
    shift = (fit.estimates - preset_values)[:-1] / fit.stderr[:-1]
    assert np.max(np.abs(shift)) < 0.02
    assert len(fit.weak()) == 1
    assert "stiffness" in fit.weak()[0]
    other = fit_rig("counterclockwise", max_steps=20)
    assert other.chi_square > 1e3 * fit.chi_square


@pytest.mark.slow
def test_interruption_of_chattering_comes_out(calibrated):
    """Complete chattering ends within 0.04 rpm of the printed 152.67658."""
    low, high = 152.4, 153.0
    for _ in range(16):
        middle = (low + high) / 2
        lasts, code = _lasts(calibrated, jnp.asarray(middle))
        assert int(code) == 0
        low, high = (middle, high) if bool(lasts) else (low, middle)
    assert abs(low - 152.67658) < 0.04
    assert low > 152.5 and high < 152.9


def test_unknown_target_or_size_is_refused(calibrated):
    with pytest.raises(ValueError, match="table-5.2"):
        reproduce("table-9.9", calibrated)
    with pytest.raises(ValueError, match="default or full"):
        reproduce("table-4.4", calibrated, "fine")
    assert rad_s_to_rpm(rpm_to_rad_s(1.0)) == pytest.approx(1.0)
