"""Cam profiles against closed forms, plane geometry and each other."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.models import (
    CamFollower,
    EccentricCircle,
    FourierProfile,
    SplineProfile,
)


TURN = 2 * np.pi
ANGLES = np.linspace(-7.0, 7.0, 1001)


def derivatives(profile, angles, count):
    """Values and first `count` derivatives, shape `(count + 1, len(angles))`."""
    functions = [profile]
    for _ in range(count):
        functions.append(jax.grad(functions[-1]))
    together = jax.jit(jax.vmap(lambda angle: [f(angle) for f in functions]))
    return np.stack(together(jnp.asarray(angles)))


def largest(values):
    return np.max(np.abs(values))


def test_contact_angle_range_of_table_4_4():
    # Where the contact angle is extreme, the face is parallel to the tangent of the
    # circle on which the cam's centre moves: sin(angle) = (R + d +- e) / x0.
    values = EccentricCircle()(jnp.linspace(0.0, TURN, 20001))
    expected = np.arcsin((0.045 + 0.021 + np.array([-0.015, 0.015])) / 0.249)
    # rad; the scan misses the extremum by curvature * spacing^2 / 8 < 1e-9
    assert largest([values.min() - expected[0], values.max() - expected[1]]) < 1e-9
    assert largest(expected - np.array([0.20628, 0.33133])) < 5e-6


@pytest.mark.parametrize("center_y", [0.0, 0.03, -0.05])
def test_face_of_the_follower_touches_the_circle(center_y):
    profile = EccentricCircle(center_y=center_y)
    face = np.asarray(profile(jnp.asarray(ANGLES)))
    x = 0.015 * np.cos(ANGLES) + 0.249
    y = 0.015 * np.sin(ANGLES) + center_y
    # (4.13) at the contact point (4.25), in m
    contact_x = x - 0.045 * np.sin(face)
    contact_y = y + 0.045 * np.cos(face)
    gap = np.sin(face) * contact_x - np.cos(face) * contact_y - 0.021
    assert largest(gap) < 1e-16
    # distance (m) of the cam's centre from the line (4.15) through (0, -d / cos) with
    # slope tan, by the formula for a line through two points
    first = np.stack([np.zeros_like(face), -0.021 / np.cos(face)])
    second = first + np.stack([np.ones_like(face), np.tan(face)])
    along, across = second - first, np.stack([x, y]) - first
    distance = (along[0] * across[1] - along[1] * across[0]) / np.hypot(*along)
    assert largest(distance + 0.045) < 2e-16


def test_prepared_circle_is_the_exact_one():
    exact = derivatives(EccentricCircle(), ANGLES, 3)
    series = derivatives(EccentricCircle().prepared(), ANGLES, 3)
    assert largest(exact[0] - series[0]) <= 1e-15  # rad
    assert largest(exact[1:] - series[1:]) < 1e-12  # rad, for each radian of the cam


def test_prepared_circle_is_differentiable_in_its_geometry():
    def exact(values, angle):
        return EccentricCircle(*values)(angle)

    def series(values, angle):
        return EccentricCircle(*values).prepared()(angle)

    values = jnp.array([0.045, 0.015, 0.249, 0.01, 0.021])
    for derivative in (jax.jacfwd, jax.jacrev):
        by_exact = jax.jit(derivative(exact))(values, 0.7)
        by_series = jax.jit(derivative(series))(values, 0.7)
        # rad/m; entries are of order 4
        assert largest(by_exact - by_series) < 1e-12
    # mixed second derivative, rad/m: the slope's change with the geometry
    by_exact = jax.jit(jax.jacfwd(jax.grad(exact, argnums=1)))(values, 0.7)
    by_series = jax.jit(jax.jacfwd(jax.grad(series, argnums=1)))(values, 0.7)
    assert largest(by_exact - by_series) < 1e-12


def test_prepared_circle_can_be_batched():
    radii = jnp.array([0.04, 0.045, 0.05])
    batch = jax.jit(jax.vmap(lambda r: EccentricCircle(radius=r).prepared()(0.4)))
    expected = [EccentricCircle(radius=r)(0.4) for r in radii]
    assert largest(batch(radii) - np.array(expected)) <= 1e-15  # rad


def test_too_few_harmonics_are_refused_where_values_are_known():
    profile = EccentricCircle(harmonics=5)
    with pytest.raises(ValueError, match="Increase `harmonics`"):
        profile.prepared()
    with pytest.raises(ValueError, match="Increase `harmonics`"):
        CamFollower(profile=profile).check()
    # a tracer has no value to judge
    jax.jit(lambda r: EccentricCircle(radius=r, harmonics=5).prepared()(0.4))(0.045)


def test_fourier_profile_is_its_sum():
    rng = np.random.default_rng(1)
    cosines, sines = rng.normal(size=(2, 7))
    profile = FourierProfile(0.3, cosines, sines)
    orders = np.arange(1, 8)[:, None]
    phases = orders * ANGLES
    cosines, sines = cosines[:, None], sines[:, None]
    terms = cosines * np.cos(phases) + sines * np.sin(phases)
    turned = sines * np.cos(phases) - cosines * np.sin(phases)
    expected = [
        0.3 + np.sum(terms, axis=0),
        np.sum(orders * turned, axis=0),
        -np.sum(orders**2 * terms, axis=0),
        -np.sum(orders**3 * turned, axis=0),
    ]
    computed = derivatives(profile, ANGLES, 3)
    for order, (value, known) in enumerate(zip(computed, expected, strict=True)):
        # relative to the largest term; rounding grows with the order
        assert largest(value - known) < 1e-14 * 7.0**order * 10


def test_fourier_profile_derivative_in_its_coefficients():
    def value(mean, cosines, sines):
        return FourierProfile(mean, cosines, sines)(0.6)

    arguments = (jnp.asarray(0.3), jnp.array([0.1, 0.02]), jnp.array([0.03, 0.01]))
    expected = (1.0, np.cos([0.6, 1.2]), np.sin([0.6, 1.2]))
    for derivative in (jax.jacfwd, jax.jacrev):
        for found, known in zip(
            derivative(value, argnums=(0, 1, 2))(*arguments), expected, strict=True
        ):
            assert largest(found - known) < 1e-15


def test_spline_through_even_and_uneven_tables():
    exact = EccentricCircle()
    even = np.linspace(0.0, TURN, 181)  # repeats its first point
    uneven = even[:-1] + 0.01 * np.sin(3 * even[:-1])
    for table in (even, uneven):
        spline = SplineProfile(table, exact(jnp.asarray(table))).prepared()
        error = derivatives(spline, ANGLES, 3) - derivatives(exact, ANGLES, 3)
        # rad, rad/rad^k: spacing^6 is 2e-9 and each derivative loses one power of it
        for order, bound in enumerate((1e-11, 1e-9, 1e-7, 1e-5)):
            assert largest(error[order]) < bound


def test_spline_converges_with_the_sixth_power_of_the_spacing():
    exact = EccentricCircle()
    errors = []
    for points in (20, 40):
        table = np.arange(points) * TURN / points + 0.1
        spline = SplineProfile(table, exact(jnp.asarray(table))).prepared()
        errors.append(largest(spline(jnp.asarray(ANGLES)) - exact(jnp.asarray(ANGLES))))
    assert 2.0**5.5 < errors[0] / errors[1] < 2.0**7.5


def test_spline_is_continuous_to_order_four():
    rng = np.random.default_rng(2)
    table = np.sort(rng.uniform(0.0, TURN, 12))
    spline = SplineProfile(table, rng.normal(scale=0.1, size=12)).prepared()
    # coefficients of the pieces, in powers of the angle itself
    powers = np.arange(6)
    widths = np.asarray(spline.widths)[:, None]
    factorial = np.array([1, 1, 2, 6, 24])
    begin = np.asarray(spline.coefficients)[:, :5] * factorial / widths ** powers[:5]
    end = np.stack(
        [
            np.polynomial.polynomial.polyval(
                1.0, np.polynomial.polynomial.polyder(spline.coefficients.T, k)
            )
            / widths[:, 0] ** k
            for k in range(5)
        ],
        axis=1,
    )
    jump = end - np.roll(begin, -1, axis=0)
    # each derivative relative to its largest value along the profile
    assert largest(jump / np.max(np.abs(begin), axis=0)) < 1e-10


def test_spline_is_periodic_and_interpolates():
    table = np.array([0.2, 0.9, 2.0, 2.8, 4.1, 5.0, 6.0])
    lifts = np.array([0.2, 0.3, 0.25, 0.2, 0.1, 0.15, 0.18])
    profile = SplineProfile(table, lifts)
    profile.check()
    for turns in (-2, 0, 3):
        found = profile(jnp.asarray(table + turns * TURN))
        assert largest(found - lifts) < 1e-13  # rad


def test_spline_is_differentiable_in_its_lifts():
    table = jnp.linspace(0.0, 6.0, 9)
    lifts = 0.3 + 0.1 * jnp.cos(table)
    slope = jax.jit(jax.jacfwd(lambda y: SplineProfile(table, y)(1.3)))(lifts)
    # the spline is linear in its lifts and reproduces constants
    assert abs(slope @ lifts - SplineProfile(table, lifts)(1.3)) < 1e-13
    assert abs(jnp.sum(slope) - 1.0) < 1e-13


TABLE = np.linspace(0.0, 6.0, 13)
LIFTS = 0.3 + 0.05 * np.cos(TABLE)


@pytest.mark.parametrize(
    "angles, lifts, message",
    [
        (TABLE[::-1], LIFTS, "strictly increasing"),
        (np.append(TABLE[:-1], TABLE[-2]), LIFTS, "strictly increasing"),
        (TABLE[:5], LIFTS[:5], "at least 6 points"),
        (TABLE, np.append(LIFTS[:-1], np.nan), "not finite"),
        (np.append(TABLE[:-1], np.inf), LIFTS, "not finite"),
        (np.linspace(0.0, 350.0, 13), LIFTS, "degrees"),
        (np.linspace(0.0, 7.0, 13), LIFTS, "within one turn"),
        (TABLE, np.rad2deg(LIFTS), "degrees"),
        (np.linspace(0.0, TURN, 13), np.linspace(0.2, 0.3, 13), "close"),
        (TABLE, LIFTS[:-1], "same length"),
        (TABLE.reshape(1, -1), LIFTS.reshape(1, -1), "one list"),
    ],
)
def test_tables_that_are_no_profile(angles, lifts, message):
    with pytest.raises(ValueError, match=message):
        SplineProfile(angles, lifts)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"radius": -0.01}, "`radius`"),
        ({"half_height": 0.0}, "`half_height`"),
        ({"eccentricity": np.nan}, "`eccentricity`"),
        ({"center_x": -0.249}, "right of the follower hinge"),
        ({"radius": 0.22}, "Move the cam away"),
    ],
)
def test_impossible_circles(change, message):
    with pytest.raises(ValueError, match=message):
        EccentricCircle(**change).check()


def test_profiles_with_the_wrong_number_of_harmonics():
    with pytest.raises(ValueError, match="as many sines as cosines"):
        FourierProfile(0.3, [0.1, 0.2], [0.1])
    with pytest.raises(ValueError, match="at least one harmonic"):
        FourierProfile(0.3, [], [])
    with pytest.raises(ValueError, match="at least one"):
        EccentricCircle(harmonics=0)
