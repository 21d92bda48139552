"""Tell whether the sides of surfaces can hold a motion on them."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._functions import Functions


class Hold(NamedTuple):
    """For each surface, how far the weights of its branches are from holding a motion
    on it.
    """

    # how far the weight beyond it is outside its limits, which static friction widens;
    # negative inside, -1 where the motion does not slide
    excess: list
    # whether the motion would leave it towards the side beyond it
    beyond: list


def hold_of(functions: Functions, t, x, mode) -> Hold:
    """Return the `Hold` of the surfaces along which a motion in this mode slides."""
    shares, slack = functions.shares(t, x, mode), functions.slack(mode)
    sliding = mode[functions.m + functions.k :]
    excess: list[Any] = [jnp.asarray(-1.0)] * functions.k
    beyond: list[Any] = [jnp.asarray(False)] * functions.k
    for k in functions.slidable:
        share = shares[k]
        off = jnp.maximum(-share, share - 1.0) - slack[k]
        # no side drives the motion back to a surface without a weight
        off = jnp.where(share == 0, jnp.inf, off)
        excess[k] = jnp.where(sliding[k], off, -1.0)
        beyond[k] = sliding[k] & (share > 0.5)
    return Hold(excess, beyond)
