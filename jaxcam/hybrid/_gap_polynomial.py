"""The gap inside one step, as the polynomial through its jets at both ends.

H, v, a and j at the two ends of a step fix a polynomial of degree seven. Its Bernstein
coefficients bound it from below, so a step whose coefficients are positive cannot have
crossed the constraint; the difference to the polynomial of degree five that ignores the
jerks tells how far the polynomial itself can be trusted. All functions take scalars and
are free of branches.
"""

from typing import NamedTuple

import jax.numpy as jnp


class Jet(NamedTuple):
    """Gap and its first three derivatives along the motion, at one instant."""

    gap: object
    velocity: object
    acceleration: object
    jerk: object


class Bernstein(NamedTuple):
    """Coefficients of degree seven on the step, and the trust in them."""

    coefficients: tuple
    error: object


def bernstein(left: Jet, right: Jet, h) -> Bernstein:
    """Bernstein coefficients of the gap over a step of length `h`."""
    h2, h3 = h * h, h * h * h
    v0, a0, j0 = h * left.velocity / 7, h2 * left.acceleration / 42, h3 * left.jerk / 210
    v1, a1, j1 = (
        h * right.velocity / 7,
        h2 * right.acceleration / 42,
        h3 * right.jerk / 210,
    )
    b = (
        left.gap,
        left.gap + v0,
        left.gap + 2 * v0 + a0,
        left.gap + 3 * v0 + 3 * a0 + j0,
        right.gap - 3 * v1 + 3 * a1 - j1,
        right.gap - 2 * v1 + a1,
        right.gap - v1,
        right.gap,
    )
    middle7 = (b[0] + b[7] + 7 * (b[1] + b[6]) + 21 * (b[2] + b[5])) / 128
    middle7 = middle7 + 35 * (b[3] + b[4]) / 128
    middle5 = (left.gap + right.gap) / 2 + 5 * h * (left.velocity - right.velocity) / 32
    middle5 = middle5 + h2 * (left.acceleration + right.acceleration) / 64
    return Bernstein(b, jnp.abs(middle7 - middle5))


def lowest(polynomial: Bernstein):
    """A lower bound of the gap inside the step, its error taken off.

    The error of the interpolation vanishes with its third derivative at both ends: it
    belongs to the two middle coefficients, with weight 64/35.
    """
    b = polynomial.coefficients
    outer = jnp.minimum(jnp.minimum(b[1], b[2]), jnp.minimum(b[5], b[6]))
    inner = jnp.minimum(b[3], b[4]) - 2 * polynomial.error
    return jnp.minimum(outer, inner)


def power_coefficients(left: Jet, right: Jet, h) -> tuple:
    """Coefficients c0..c7 of the same polynomial in s = time/h."""
    c0, c1 = left.gap, h * left.velocity
    c2, c3 = h * h * left.acceleration / 2, h * h * h * left.jerk / 6
    r0 = right.gap - (c0 + c1 + c2 + c3)
    r1 = h * right.velocity - (c1 + 2 * c2 + 3 * c3)
    r2 = h * h * right.acceleration / 2 - (c2 + 3 * c3)
    r3 = h * h * h * right.jerk / 6 - c3
    return (
        c0,
        c1,
        c2,
        c3,
        35 * r0 - 15 * r1 + 5 * r2 - r3,
        -84 * r0 + 39 * r1 - 14 * r2 + 3 * r3,
        70 * r0 - 34 * r1 + 13 * r2 - 3 * r3,
        -20 * r0 + 10 * r1 - 4 * r2 + r3,
    )


def _value_and_slope(c, s):
    value, slope = c[-1], jnp.zeros_like(s)
    for coefficient in c[-2::-1]:
        slope = slope * s + value
        value = value * s + coefficient
    return value, slope


def crossing(c, halvings: int = 3, newtons: int = 3):
    """Where in (0, 1) the polynomial falls below zero, given that it does by the end.

    A few halvings find the neighbourhood, Newton inside the bracket finds the root.
    """
    low, high = jnp.zeros_like(c[0]), jnp.ones_like(c[0])
    for _ in range(halvings):
        middle = (low + high) / 2
        value, _ = _value_and_slope(c, middle)
        low = jnp.where(value > 0, middle, low)
        high = jnp.where(value > 0, high, middle)
    s = high
    for _ in range(newtons):
        value, slope = _value_and_slope(c, s)
        step = s - value / jnp.where(slope == 0, -1.0, slope)
        middle = (low + high) / 2
        s = jnp.where((slope < 0) & (step > low) & (step <= high), step, middle)
        value, _ = _value_and_slope(c, s)
        low = jnp.where(value > 0, s, low)
        high = jnp.where(value > 0, high, s)
    return s


def lowest_point(polynomial: Bernstein, c):
    """Where in (0, 1) the polynomial is suspected to dip: its minimum, nearly."""
    b = polynomial.coefficients
    s, best = jnp.full_like(c[0], 1 / 7), b[1]
    for k in range(2, 7):
        s = jnp.where(b[k] < best, k / 7, s)
        best = jnp.minimum(b[k], best)
    slope_of = tuple(k * c[k] for k in range(1, 8))
    for _ in range(3):
        slope, bend = _value_and_slope(slope_of, s)
        step = s - slope / jnp.where(bend == 0, 1.0, bend)
        s = jnp.where(bend > 0, jnp.clip(step, 0.02, 0.98), s)
    return s


def time_to_contact(jet: Jet):
    """Time until the cubic through the jet reaches zero from above; inf where it does not.

    Two cases: leaving the surface (gap zero, v > 0), where the cubic has an exact
    smallest root, and approaching it, where the parabola's root is refined twice.
    """
    g, v, a, j = jet
    infinite = jnp.full_like(v, jnp.inf)

    square = a * a / 4 - 2 * v * j / 3
    below = jnp.sqrt(jnp.where(square > 0, square, 1.0)) - a / 2
    hop = jnp.where(
        (square > 0) & (below > 0), 2 * v / jnp.where(below > 0, below, 1.0), infinite
    )

    square = v * v - 2 * a * g
    below = jnp.sqrt(jnp.where(square > 0, square, 1.0)) - v
    fall = jnp.where(
        (square > 0) & (below > 0), 2 * g / jnp.where(below > 0, below, 1.0), infinite
    )
    finite = jnp.where(jnp.isfinite(fall), fall, 0.0)
    for _ in range(2):
        value = g + finite * (v + finite * (a / 2 + finite * j / 6))
        slope = v + finite * (a + finite * j / 2)
        finite = finite - value / jnp.where(slope < 0, slope, -jnp.inf)
    fall = jnp.where(jnp.isfinite(fall) & (finite > 0), finite, fall)
    # the start of a hop: the height already gained is small against the apex
    leaving = (v > 0) & (jnp.abs(g * a) < 1e-3 * v * v)
    return jnp.where(leaving, hop, fall)


def time_to_root(jet: Jet, newtons: int = 3):
    """Signed time from here to the nearby zero of the cubic, by Newton's method."""
    g, v, a, j = jet
    tau = jnp.zeros_like(g)
    for _ in range(newtons):
        value = g + tau * (v + tau * (a / 2 + tau * j / 6))
        slope = v + tau * (a + tau * j / 2)
        tau = tau - value / jnp.where(slope == 0, 1.0, slope)
    return tau
