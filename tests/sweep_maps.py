"""Maps whose basins are known, also for child processes of the tests."""

import jax.numpy as jnp
import numpy as np

from jaxcam.sweeps import Map


#: in cells of 3^-9, whose centres are never on the boundary
CANTOR_CELLS = 3**9
CANTOR_DIMENSION = np.log(2) / np.log(3)


def square_root(z, p):
    """Newton's method for z^2 = 1: the sign of Re z decides."""
    del p
    square = z[0] ** 2 + z[1] ** 2
    return jnp.stack([(z[0] + z[0] / square) / 2, (z[1] - z[1] / square) / 2])


def squared(z, p):
    """z^2: inside the unit circle to zero, outside to infinity."""
    del p
    return jnp.stack([z[0] ** 2 - z[1] ** 2, 2 * z[0] * z[1]])


def logistic(x, p):
    return p["mu"] * x * (1 - x)


def middle_third(x, p):
    """Points that leave [0, 1] by the left or the right half of its middle third.

    Those of the Cantor set never do: it is the boundary between those that end at 2 and
    those that end at 3.
    """
    del p
    y = x[0]
    gone = jnp.where(y < 0.5, 2.0, 3.0)
    inside = jnp.where(y < 1 / 3, 3 * y, jnp.where(y > 2 / 3, 3 * y - 2, gone))
    return jnp.where((y >= 0) & (y <= 1), inside, y)[None]


def turned(x, p):
    """A plane turned by a right angle: every state has period four."""
    del p
    return jnp.stack([-x[1], x[0]])


SQUARE_ROOT = Map(square_root)
SQUARED = Map(squared)
LOGISTIC = Map(logistic, {"mu": 2.0})
MIDDLE_THIRD = Map(middle_third)
TURNED = Map(turned)
