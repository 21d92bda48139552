"""Sine and cosine in plain arithmetic.

A library call inside a vectorised loop stops the compiler from keeping the loop in
registers. These few multiplications do not, and are accurate to about one unit in the
last place for |x| < 1e6; beyond that the reduction to one quarter turn loses digits in
proportion to x.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np


# pi/2 in three parts of 33 bits each, so that a small integer times one is exact
_PART_1 = 1.5707963267341256
_PART_2 = 6.077100506303966e-11
_PART_3 = 2.0222662487959506e-21
# minimax coefficients on |x| <= pi/4 (FreeBSD msun, k_sin.c and k_cos.c)
_SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
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
    turns = jnp.round(x * (2 / np.pi))
    r = ((x - turns * _PART_1) - turns * _PART_2) - turns * _PART_3
    z = r * r
    sine = r + r * z * _horner(_SINE, z)
    cosine = 1.0 - 0.5 * z + z * z * _horner(_COSINE, z)
    half = 0.5 * turns
    odd = half != jnp.floor(half)
    quarter = 0.25 * turns
    quadrant = 4.0 * (quarter - jnp.floor(quarter))
    s = jnp.where(odd, cosine, sine)
    c = jnp.where(odd, sine, cosine)
    s = jnp.where(quadrant > 1.5, -s, s)
    c = jnp.where((quadrant > 0.5) & (quadrant < 2.5), -c, c)
    return s, c


@sincos.defjvp
def _sincos_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    s, c = sincos(x)
    return (s, c), (c * dx, -s * dx)
