"""Sine and cosine in plain arithmetic.

A library call inside a vectorised loop prevents the compiler from keeping the loop in
registers. The few multiplications used here do not. Their absolute error is about 2e-16
for |x| < 1e6; beyond that, the reduction to half a turn loses digits in proportion
to x.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np


# pi in two parts, the first of 33 bits, so that a small integer times it is exact
_PART_1 = 3.1415926534682512
_PART_2 = 1.2154201013012384e-10
# (sine/x - 1) / x^2 and (cosine - 1 + x^2/2) / x^4, minimax on |x| <= pi/2: the error
# of the polynomials is 1e-18
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
    0.041666666666666664,
    -0.0013888888888888753,
    2.4801587301538702e-05,
    -2.7557319214964993e-07,
    2.087675602140945e-09,
    -1.1470683839714558e-11,
    4.777154258303268e-14,
    -1.514392435549192e-16,
)


def _eight(c, z, z2, z4):
    """Return a polynomial of eight coefficients in `z`, with few sequential steps."""
    low = (c[0] + c[1] * z) + (c[2] + c[3] * z) * z2
    high = (c[4] + c[5] * z) + (c[6] + c[7] * z) * z2
    return low + high * z4


@jax.custom_jvp
def sincos(x):
    """Return the sine and cosine of `x` (rad, float64, any shape)."""
    return _arithmetic(x)


# traced once for each shape, then copied, because a loop body contains it dozens of
# times
@partial(jax.jit, inline=True)
def _arithmetic(x):
    halves = jnp.round(x * (1 / np.pi))
    r = (x - halves * _PART_1) - halves * _PART_2
    z = r * r
    z2 = z * z
    z4 = z2 * z2
    sine = r + r * z * _eight(_SINE, z, z2, z4)
    cosine = (1.0 - 0.5 * z) + z2 * _eight(_COSINE, z, z2, z4)
    # an odd number of half turns changes both signs
    pairs = 0.5 * halves
    sign = 1.0 - 4.0 * (pairs - jnp.floor(pairs))
    return sign * sine, sign * cosine


@sincos.defjvp
def _sincos_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    s, c = sincos(x)
    return (s, c), (c * dx, -s * dx)
