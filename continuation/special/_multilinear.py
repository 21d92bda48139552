"""Second and third derivatives of a vector function along given directions."""

import jax


def second(function, u, parameters, a, b):
    """B(a, b), the second derivative with respect to u."""

    def first(u):
        return jax.jvp(lambda u: function(u, parameters), (u,), (a,))[1]

    return jax.jvp(first, (u,), (b,))[1]


def third(function, u, parameters, a, b, c):
    """C(a, b, c), the third derivative with respect to u."""
    return jax.jvp(lambda u: second(function, u, parameters, a, b), (u,), (c,))[1]
