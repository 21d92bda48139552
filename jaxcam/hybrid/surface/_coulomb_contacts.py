"""Impulses of several closed contacts with Coulomb friction, by trying all states.

Each contact is open, slips in the positive or the negative direction, or sticks. With
the normal velocities v and slip velocities s after the impulses, and the impulses a and
b during positive and negative slip (both are normal impulses, with the friction that
belongs to them):

- open: a = b = 0 and v >= 0;
- positive slip: v = 0, b = 0, a >= 0 and s >= 0;
- negative slip: v = 0, a = 0, b >= 0 and s <= 0;
- sticking: v = 0, s = 0, a >= 0 and b >= 0.

This is a linear complementarity problem (C. Glocker, F. Pfeiffer, Multiple impacts with
friction in rigid multibody systems, Nonlinear Dynamics 7, 1995). For a few contacts,
each of the 4^m combinations of states is a small linear system.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int


_SLIPS_BACK, _STICKS = 2, 3
# violations of a condition below this, relative to the velocities, are rounding errors
_ROUNDING = 1e-10


def contact_impulses(
    matrix: Float[Array, "k k"],
    velocities: Float[Array, " k"],
    closed: Bool[Array, " m"],
    sizes: Float[Array, " k"],
    given: Float[Array, " m"] | None = None,
) -> Float[Array, " k"]:
    """Return two impulses of each `closed` contact: the parts of the normal impulses
    during negative slip, then the normal impulses.

    If the latter are `given`, only the former are determined.

    If several combinations of states fulfil all conditions, as for a body that jams
    between its contacts, the solution is the one with the smallest sum of impulses. The
    loop over the combinations does nothing if no contact is closed.

    **Arguments:**

    - `matrix`: the changes of all slip velocities, then of all normal velocities (rows)
      by a unit of impulse that is transferred from positive to negative slip at each
      contact, then by a unit of impulse during positive slip at each (columns). A row
      of a contact without friction is zero.
    - `velocities`: the slip velocities, then the normal velocities.
    - `sizes`: the sizes of these velocities, positive, for their rounding errors.
    """
    number = len(closed)
    states = 4 if given is None else 3
    combinations = jnp.where(jnp.any(closed), states**number, 0)
    known = jax.lax.stop_gradient((matrix, velocities, given))
    size = sizes[-1]

    def better(carry):
        index, best, found = carry
        codes = _states(index, number, given)
        impulses, after = _solved(*known, codes)
        least = _least(impulses / size, after / sizes, codes, closed, given)
        # the rank is positive if the combination is valid
        small = size / (size + jnp.sum(impulses[number:]))
        rank = jnp.where(least >= -_ROUNDING, small, least)
        improves = rank > best
        return (
            index + 1,
            jnp.where(improves, rank, best),
            jnp.where(improves, index, found),
        )

    def unfinished(carry):
        return carry[0] < combinations

    zero = jnp.asarray(0)
    start = zero, jnp.asarray(-jnp.inf), zero
    _, _, found = jax.lax.while_loop(unfinished, better, start)
    codes = _states(found, number, given)
    return _solved(matrix, velocities, given, codes)[0]


def _states(index, number: int, given) -> Int[Array, " m"]:
    """Return the state of each contact in the combination with this index: 0 is open, 1
    slips in the positive direction, 2 in the negative direction, and 3 sticks.

    If the normal impulses are `given`, no contact is open.
    """
    places = jnp.arange(number)
    if given is None:
        return (index // 4**places) % 4
    return 1 + (index // 3**places) % 3


def _solved(matrix, velocities, given, codes):
    """Return the impulses for these contact states, and the velocities that result."""
    number = len(codes)
    back, sticks = codes == _SLIPS_BACK, codes == _STICKS
    transfer = matrix[:, :number]
    normal = matrix[:, number:] + jnp.where(back[None, :], transfer, 0.0)
    presses = codes > 0
    start, fixed = velocities, jnp.zeros(number)
    if given is not None:
        start, fixed = velocities + normal @ given, given
        presses = jnp.zeros(number, dtype=bool)
    whole = jnp.concatenate([transfer, normal], axis=1)
    # friction is eliminated first, because its part of the matrix always has positive
    # pivots
    found = _eliminated(whole, -start, jnp.concatenate([sticks, presses]))
    total = found[number:] + fixed
    negative = found[:number] + jnp.where(back, total, 0.0)
    return jnp.concatenate([negative, total]), start + whole @ found


def _eliminated(matrix, right, mask):
    """Return the solution for the masked unknowns, zero elsewhere.

    Gauss-Jordan elimination compiles fast, because it operates on entire rows.
    """
    number = len(right)
    rows = jnp.where(mask[:, None] & mask[None, :], matrix, jnp.eye(number))
    rows = jnp.concatenate([rows, jnp.where(mask, right, 0.0)[:, None]], axis=1)
    for p in range(number):
        pivot = rows[p] / rows[p, p]
        others = jnp.where(jnp.arange(number) == p, 0.0, rows[:, p])
        rows = (rows - others[:, None] * pivot[None, :]).at[p].set(pivot)
    return rows[:, -1]


def _least(impulses, after, codes, closed, given):
    """Return the smallest margin of all conditions, negative if one is violated."""
    number = len(codes)
    slips, normals = after[:number], after[number:]
    negative, total = impulses[:number], impulses[number:]
    slip = jnp.where(codes == _SLIPS_BACK, -slips, slips)
    holds = jnp.minimum(negative, total - negative)
    rubs = jnp.where(codes == _STICKS, holds, slip)
    if given is None:
        touches = codes > 0
        least = jnp.where(touches, jnp.minimum(total, rubs), normals)
        outside = jnp.where(touches, -jnp.inf, jnp.inf)
    else:
        least, outside = rubs, jnp.full(number, jnp.inf)
    return jnp.min(jnp.where(closed, least, outside))
