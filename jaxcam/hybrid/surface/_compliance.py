"""Find where friction causes a contact force not to exist or not to be unique.

While a body slips, the normal acceleration of a contact is a + c q: a is its value
without the contact force q, and c, which is one without friction, changes in proportion
to the friction coefficient. If c <= 0, pressing does not push the body away: there is
no contact force for a < 0, and there are two for a > 0 (P. Painleve, Comptes Rendus
121, 1895; F. Genot, B. Brogliato, New results on Painleve paradoxes, European Journal
of Mechanics A 18, 1999). With several contacts, c is a matrix, and the forces exist and
are unique for every a if all its principal minors are positive (R. W. Cottle, J.-S.
Pang, R. E. Stone, The Linear Complementarity Problem, 1992, section 3.3).
"""

import itertools

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._contact_friction import friction_on
from ._normal import normal_directions, normal_velocity
from ._slide_terms import InMode
from ._switches import OnSides


# only minors of up to this many rows are examined
_LARGEST = 3
# redundant contacts, whose minor is below this without friction, are not examined
_REDUNDANT = 1e-9


def least_compliance(mode: InMode, t, x) -> Float[Array, ""]:
    """Return the smallest principal minor of c, relative to its value without friction.

    A body that sticks may slip to either side, so both are examined. Without a contact,
    the result is one.

    Args:
        mode: The system with friction, in its mode.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        A scalar; the contact forces are unique where it is positive.
    """
    system = OnSides(mode.system, mode.negative)
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    push = normal_directions(system, t, x)
    free = slope @ push.T

    def least(sides):
        matrix = slope @ (push + friction_on(system, t, x, sides)).T
        return _least_minor(matrix, free, mode.contact)

    found = least(mode.signs)
    for k in mode.slidable:
        other = least(mode.signs.at[k].multiply(-1.0))
        found = jnp.where(mode.sliding[k], jnp.minimum(found, other), found)
    return found


def _least_minor(matrix, free, contact):
    """Return the smallest ratio of the principal minors of two matrices."""
    number, found = len(contact), jnp.ones(())
    for size in range(1, min(number, _LARGEST) + 1):
        for chosen in itertools.combinations(range(number), size):
            scale = _minor(free, chosen, chosen)
            counts = scale > _REDUNDANT
            for k in chosen:
                counts = counts & contact[k]
            ratio = _minor(matrix, chosen, chosen) / jnp.where(counts, scale, 1.0)
            found = jnp.where(counts, jnp.minimum(found, ratio), found)
    return found


def _minor(matrix, rows, columns):
    """Return the determinant of the given rows and columns, by expansion."""
    if not rows:
        return jnp.ones(())
    total = jnp.zeros(())
    for i, column in enumerate(columns):
        rest = columns[:i] + columns[i + 1 :]
        part = matrix[rows[0], column] * _minor(matrix, rows[1:], rest)
        total = total + part if i % 2 == 0 else total - part
    return total
