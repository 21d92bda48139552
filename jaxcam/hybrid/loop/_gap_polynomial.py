"""The gap within one step, as the polynomial through its jets at both ends.

The gap g and its first three derivatives v, a and j at the two ends of a step determine
a polynomial of degree seven. Its Bernstein coefficients bound it from below: if they
are positive, the step has not crossed the constraint, to within the error of the
polynomial. That error is estimated by the difference from the polynomial of degree five
that ignores the jerks j. All functions take scalars and have no branches.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp


class Jet(NamedTuple):
    """Gap and its first three derivatives along the motion, at one instant."""

    gap: Any
    velocity: Any
    acceleration: Any
    jerk: Any


class Bernstein(NamedTuple):
    """Bernstein coefficients of degree seven on the step, and the error of the
    polynomial.
    """

    coefficients: tuple
    error: Any


def _scaled(jet: Jet, h) -> tuple:
    """Return the coefficients of the cubic through a jet, as a function of time /
    `h`.
    """
    h2 = h * h
    return (
        jet.gap,
        h * jet.velocity,
        h2 * jet.acceleration * 0.5,
        h2 * h * jet.jerk * (1 / 6),
    )


def _remainders(left: tuple, right: tuple) -> tuple:
    """Return the errors of the left parabola at the right end: coefficients of orders
    zero to two, as in `_scaled`.
    """
    c0, c1, c2, _ = left
    e0, e1, e2, _ = right
    return e0 - (c0 + c1 + c2), e1 - (c1 + 2 * c2), e2 - c2


def bernstein(left: Jet, right: Jet, h) -> Bernstein:
    """Return the Bernstein coefficients of the gap over a step of length `h`."""
    (c0, c1, c2, c3), (e0, e1, e2, e3) = _scaled(left, h), _scaled(right, h)
    b = (
        c0,
        c0 + c1 * (1 / 7),
        c0 + c1 * (2 / 7) + c2 * (1 / 21),
        c0 + c1 * (3 / 7) + c2 * (1 / 7) + c3 * (1 / 35),
        e0 - e1 * (3 / 7) + e2 * (1 / 7) - e3 * (1 / 35),
        e0 - e1 * (2 / 7) + e2 * (1 / 21),
        e0 - e1 * (1 / 7),
        e0,
    )
    return Bernstein(b, _mistrust(left, right, h))


def _mistrust(left: Jet, right: Jet, h):
    """Return a bound on the difference from the polynomial of degree five, which
    ignores the jerks.

    The difference is s^3 (1-s)^3 (p + q (2s - 1)); its third-order coefficients at the
    ends are the differences of the jerks there.
    """
    at_left, at_right = _scaled(left, h), _scaled(right, h)
    r0, r1, r2 = _remainders(at_left, at_right)
    first = at_left[3] - (10 * r0 - 4 * r1 + r2)
    last = at_right[3] - (10 * r0 - 6 * r1 + 3 * r2)
    return jnp.maximum(jnp.abs(first), jnp.abs(last)) * (1 / 64)


def lowest(polynomial: Bernstein):
    """Return a lower bound on the gap within the step, minus the interpolation error.

    The interpolation error vanishes together with its derivatives up to the third at
    both ends, so it is assigned to the two middle coefficients, with weight 64/35.
    """
    b = polynomial.coefficients
    outer = jnp.minimum(jnp.minimum(b[1], b[2]), jnp.minimum(b[5], b[6]))
    inner = jnp.minimum(b[3], b[4]) - 2 * polynomial.error
    return jnp.minimum(outer, inner)


def power_coefficients(left: Jet, right: Jet, h) -> tuple:
    """Return the coefficients c0..c7 of the polynomial as powers of s = time/h."""
    at_left, at_right = _scaled(left, h), _scaled(right, h)
    r0, r1, r2 = _remainders(at_left, at_right)
    c3, e3 = at_left[3], at_right[3]
    return (
        *at_left,
        35 * r0 - 15 * r1 + 5 * r2 - e3 - 4 * c3,
        -84 * r0 + 39 * r1 - 14 * r2 + 3 * e3 + 6 * c3,
        70 * r0 - 34 * r1 + 13 * r2 - 3 * e3 - 4 * c3,
        -20 * r0 + 10 * r1 - 4 * r2 + e3 + c3,
    )


def _value_and_slope(c, s):
    value, slope = c[-1], jnp.zeros_like(s)
    for coefficient in c[-2::-1]:
        slope = slope * s + value
        value = value * s + coefficient
    return value, slope


def crossing(c, halvings: int = 3, newtons: int = 2):
    """Return where in (0, 1) the polynomial falls below zero, provided that it does.

    A few bisections find the neighbourhood, then Newton's method within the bracket
    finds the root.
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
    """Return an estimate of where in (0, 1) the polynomial is lowest."""
    b = polynomial.coefficients
    s, best = jnp.full_like(c[0], 1 / 7), b[1]
    for k in range(2, 7):
        s = jnp.where(b[k] < best, k / 7, s)
        best = jnp.minimum(b[k], best)
    slope, bend = _value_and_slope(tuple(k * c[k] for k in range(1, 8)), s)
    step = s - slope / jnp.where(bend == 0, 1.0, bend)
    return jnp.where(bend > 0, jnp.clip(step, 0.02, 0.98), s)


def time_to_contact(jet: Jet, snap):
    """Return the time until the quartic through the jet falls to zero; inf if it does
    not.

    When the motion leaves the surface (v > 0 at a small gap), the smallest root of the
    cubic is known exactly; otherwise, the root of the parabola is used. One Newton step
    follows, with the rate of the jerk `snap`, which need not be accurate and is omitted
    if its effect is large.
    """
    g, v, a, j = jet
    leaving = (v > 0) & (jnp.abs(g * a) < 1e-3 * v * v)
    square = jnp.where(leaving, a * a * 0.25 - v * j * (2 / 3), v * v - 2 * a * g)
    possible = square > 0
    root = jnp.sqrt(jnp.where(possible, square, 1.0))
    below = root - jnp.where(leaving, a / 2, v)
    possible = possible & (below > 0)
    time = 2 * jnp.where(leaving, v, g) / jnp.where(possible, below, 1.0)
    value = g + time * (v + time * (a * 0.5 + time * j * (1 / 6)))
    slope = v + time * (a + time * j * 0.5)
    bend = snap * time * time * time
    more = jnp.where(jnp.abs(bend) <= 2 * jnp.abs(slope), bend, 0.0)
    value, slope = value + time * more * (1 / 24), slope + more * (1 / 6)
    refined = time - value / jnp.where(slope < 0, slope, -1.0)
    refined = jnp.where((slope < 0) & (refined > 0), refined, time)
    return jnp.where(possible, refined, jnp.inf)


def time_to_release(left: Jet, right: Jet, inverse):
    """Return the time until the acceleration rises through zero; inf if it does not.

    The cubic through a and j at both ends of a step is extrapolated beyond its end: the
    root of its parabola there is refined. `inverse` is the inverse of the step length.
    """
    a, j = right.acceleration, right.jerk
    bend = end_curvature(left, right, inverse)
    square = j * j - 2 * a * bend
    below = j + jnp.sqrt(jnp.where(square > 0, square, 0.0))
    rises = (a < 0) & (square > 0) & (below > 0)
    time = -2 * a / jnp.where(rises, below, 1.0)
    third = (
        6 * inverse * inverse * (left.jerk + j + 2 * inverse * (left.acceleration - a))
    )
    for _ in range(2):
        value = a + time * (j + time * (bend * 0.5 + time * third * (1 / 6)))
        slope = j + time * (bend + time * third / 2)
        step = time - value / jnp.where(slope > 0, slope, 1.0)
        time = jnp.where((slope > 0) & (step > 0), step, time)
    return jnp.where(rises, time, jnp.inf)


def end_curvature(left: Jet, right: Jet, inverse):
    """Return the second derivative, at the end of a step, of the cubic through a and j
    at both ends.

    `inverse` is the inverse of the step length.
    """
    bend = 6 * inverse * (left.acceleration - right.acceleration)
    return inverse * (bend + 2 * left.jerk + 4 * right.jerk)


def time_to_root(jet: Jet):
    """Return the signed time to the nearby zero of the cubic, if |g a| is small
    compared with v^2.

    The time follows from the series that inverts the cubic, to fourth order in g/v.
    """
    g, v, a, j = jet
    inverse = 1.0 / jnp.where(v == 0, 1.0, v)
    w, p, q = -g * inverse, a * inverse * 0.5, j * inverse * (1 / 6)
    return w * (1 - w * (p - w * (2 * p * p - q - 5 * w * p * (p * p - q))))
