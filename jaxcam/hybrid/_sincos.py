"""Sine and cosine in plain arithmetic.

A library call inside a vectorised loop stops the compiler from keeping the loop in
registers. These few multiplications do not, and err by some 2e-16 for |x| < 1e6; beyond
that the reduction to half a turn loses digits in proportion to x.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np


# pi in three parts of 33 bits each, so that a small integer times one is exact
_PART_1 = 3.1415926534682512
_PART_2 = 1.2154201012607932e-10
_PART_3 = 4.044532497591901e-21
# sine/x - 1 over x^2, and cosine - 1 + x^2/2 over x^4, minimax on |x| <= pi/2: the
# polynomials err by 1e-18 relatively and 6e-18
_SINE = (
    -0.16666666666666666,
    0.008333333333333184,
    -0.00019841269841200154,
    2.755731920908703e-06,
    -2.5052106662984926e-08,
    1.6058928677310376e-10,
    -7.64270079474087e-13,
    2.718126159624367e-15,
)
_COSINE = (
    0.04166666666666583,
    -0.0013888888888829898,
    2.480158728575615e-05,
    -2.7557317065920285e-07,
    2.087659246159648e-09,
    -1.1463632032790307e-11,
    4.616099370314045e-14,
)


def _horner(coefficients, z):
    value = jnp.full_like(z, coefficients[-1])
    for c in coefficients[-2::-1]:
        value = value * z + c
    return value


@jax.custom_jvp
def sincos(x):
    """Sine and cosine of `x` (rad, float64, any shape)."""
    return _arithmetic(x)


# traced once for each shape, then copied: a loop body holds dozens of these
@partial(jax.jit, inline=True)
def _arithmetic(x):
    halves = jnp.round(x * (1 / np.pi))
    r = ((x - halves * _PART_1) - halves * _PART_2) - halves * _PART_3
    z = r * r
    sine = r + r * z * _horner(_SINE, z)
    cosine = 1.0 - 0.5 * z + z * z * _horner(_COSINE, z)
    # half a turn changes both signs
    pairs = 0.5 * halves
    sign = 1.0 - 4.0 * (pairs - jnp.floor(pairs))
    return sign * sine, sign * cosine


@sincos.defjvp
def _sincos_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    s, c = sincos(x)
    return (s, c), (c * dx, -s * dx)
