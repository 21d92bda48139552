"""Tell whether the sides of surfaces can hold a motion on them."""

import jax.numpy as jnp

from ._functions import Functions


def held_on(functions: Functions, t, x, mode) -> list:
    """Return for each surface whether a motion in this mode can slide along it.

    The weights of the branches must be within their limits, which static friction
    widens. False where the motion does not slide.
    """
    shares, slack = functions.shares(t, x, mode), functions.slack(mode)
    sliding = mode[functions.m + functions.k :]
    found = [jnp.asarray(False)] * functions.k
    for k in functions.slidable:
        inside = (shares[k] + slack[k]) * (1 + slack[k] - shares[k]) >= 0
        # no side drives the motion back to a surface without a weight
        found[k] = sliding[k] & inside & (shares[k] != 0)
    return found
