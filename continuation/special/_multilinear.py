"""Compute second and third derivatives of a vector function along directions."""

import jax


def second(function, u, a, b):
    """Return B(a, b), the second derivative of a function at u along a and b."""

    def first(u):
        return jax.jvp(function, (u,), (a,))[1]

    return jax.jvp(first, (u,), (b,))[1]


def third(function, u, a, b, c):
    """Return C(a, b, c), the third derivative of a function at u along a, b and c."""
    return jax.jvp(lambda u: second(function, u, a, b), (u,), (c,))[1]
