"""Compute second and third derivatives of a vector function along directions."""

import jax


def second(function, u, a, b):
    """Return B(a, b), the second derivative at u."""

    def first(u):
        return jax.jvp(function, (u,), (a,))[1]

    return jax.jvp(first, (u,), (b,))[1]


def third(function, u, a, b, c):
    """Return C(a, b, c), the third derivative at u."""
    return jax.jvp(lambda u: second(function, u, a, b), (u,), (c,))[1]
