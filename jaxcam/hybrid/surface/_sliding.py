"""Derive the motion relative to switching surfaces: crossing, sliding and its end.

The distance from a surface is its switching function on the side of the motion, plus
its hysteresis. Like a gap, it is positive before and zero at a crossing. While the
motion slides, the distance is (b + s) (1 + s - b) instead, with the weight b of
`_slide_terms.py` and s = (holding - 1) / 2: sliding ends where this expression falls to
zero.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._types import State
from ._contact_forces import contact_forces, Distances, multipliers_at_ends
from ._equal_slips import solve_equal_slips
from ._normal import along_path, gaps, motion_rates
from ._rounding import gap_rounding, rounding_of
from ._slide_terms import combined, InMode, shares, slide_terms, slides_on
from ._switches import OnSides, surfaces


def field_in_mode(mode: InMode, t, x) -> State:
    """Return the field of free flight, contact or sliding."""
    return forces_in_mode(mode, t, x)[1]


def forces_in_mode(mode: InMode, t, x) -> tuple[Float[Array, " m"], State]:
    """Return the multipliers of the constraints, and the field.

    Like the field, the multipliers are those of the branch plus their weighted changes
    beyond the surfaces.
    """
    if not mode.slidable:
        if mode.contact.shape[0]:
            return contact_forces(mode, t, x, mode.contact)
        return jnp.zeros((0,)), mode.vector_field(t, x)
    terms = slide_terms(mode, t, x)
    total = terms.multipliers
    for change, share, k in zip(
        terms.changes, shares(mode, terms), mode.slidable, strict=True
    ):
        total = total + jnp.where(mode.sliding[k], share * change, 0.0)
    return total, combined(mode, terms)


def _of_each(value, mode: OnSides) -> Float[Array, " k"]:
    """Return one value for each surface, from a single number or a vector."""
    return jnp.broadcast_to(jnp.asarray(value, dtype=jnp.float64), mode.negative.shape)


def slack_of_hold(mode: OnSides) -> Float[Array, " k"]:
    """Return s = (holding - 1) / 2 of each surface."""
    return (_of_each(mode.system.holding, mode) - 1.0) / 2


def open_distances(mode: OnSides, t, x) -> Float[Array, " k"]:
    """Return the distance of a motion that does not slide from each surface, shape
    `(k,)`.
    """
    return mode.system.distances(t, x, mode.signs)


def switching_distances(mode: InMode, t, x) -> Float[Array, " k"]:
    """Return the distance from each surface, zero at a crossing or at the end of
    sliding, shape `(k,)`.
    """
    open_ones = open_distances(mode, t, x)
    if not mode.slidable:
        return open_ones
    terms = slide_terms(mode, t, x)
    found, slack = shares(mode, terms), slack_of_hold(mode)
    rows = [open_ones[k] for k in range(len(mode.jumps))]
    for i, k in enumerate(mode.slidable):
        left = (found[i] + slack[k]) * (1 + slack[k] - found[i])
        # -1 if both branches drive the motion away from the surface
        left = jnp.where(terms.firm[i], left, -1.0)
        rows[k] = jnp.where(mode.sliding[k], left, rows[k])
    return jnp.stack(rows)


def open_surfaces(mode: InMode, t, x) -> tuple:
    """Return the distance from each surface and its first three derivatives, `(k, 4)`,
    and the rounding error of the distance, `(k,)`, for a motion that does not slide.
    """
    side = OnSides(mode.system, mode.negative)

    def field(s, y):
        if not mode.contact.shape[0] or not mode.slidable:
            return side.vector_field(s, y)
        return contact_forces(side, s, y, mode.contact)[1]

    def distance(s, y):
        return open_distances(mode, s, y)

    rates = motion_rates(field, t, x)
    jets = jnp.stack(along_path(distance, t, x, rates, 3), axis=1)
    return jets, rounding_of(distance, t, x, jnp.abs(x))


def beyond_shares(mode: InMode, t, x) -> Float[Array, " k"]:
    """Return the weight of the branch beyond each surface, shape `(k,)`; zero where the
    motion does not slide.
    """
    found = list(shares(mode, slide_terms(mode, t, x)))
    places = {k: share for k, share in zip(mode.slidable, found, strict=True)}
    return jnp.stack([places.get(k, 0 * t) for k in range(len(mode.jumps))])


def hold_of(mode: InMode, t, x) -> Float[Array, "2 k"]:
    """Return how far the weight of the branch beyond each surface is outside its
    limits, which static friction widens, and this weight.

    The excess is negative inside the limits, infinite if no side drives the motion
    back, and -1 where the motion does not slide.
    """
    terms = slide_terms(mode, t, x)
    found, slack = shares(mode, terms), slack_of_hold(mode)
    off, weights = [-jnp.ones_like(t)] * len(mode.jumps), [0 * t] * len(mode.jumps)
    for i, k in enumerate(mode.slidable):
        beyond = jnp.maximum(-found[i], found[i] - 1) - slack[k]
        beyond = jnp.where(terms.firm[i], beyond, jnp.inf)
        off[k] = jnp.where(mode.sliding[k], beyond, off[k])
        weights[k] = found[i]
    return jnp.stack([jnp.stack(off), jnp.stack(weights)])


def settled(mode: InMode, t, x) -> Float[Array, "rows n"]:
    """Return the state moved by one Newton step onto the surfaces on which the motion
    slides, then the change of the field beyond each surface, zero without sliding.

    The state moves in the directions in which the field jumps, as it does over a short
    time of sliding: a velocity is corrected by the friction that holds it.
    """
    terms = slide_terms(mode, t, x)
    on = slides_on(mode)
    lengths = solve_equal_slips(terms.gains, terms.heights, on & terms.firm, 0.0)
    kicks = jnp.where(on[:, None], terms.kicks, 0.0)
    moves = jnp.where((on & terms.firm)[:, None], terms.kicks, 0.0)
    after = x - jnp.sum(lengths[:, None] * moves, axis=0)
    return jnp.concatenate([after[None], kicks])


def heights_rounded(mode: OnSides, t, x, reach: State) -> Float[Array, "2 k"]:
    """Return the switching functions, and their rounding errors for components as large
    as `reach`.
    """

    def values(s, y):
        return surfaces(mode.system, s, y)

    return jnp.stack([values(t, x), rounding_of(values, t, x, reach)])


def field_and_distances_in_mode(mode: InMode, t, x) -> tuple[State, Distances]:
    """Return the field and the `Distances` in this mode."""
    multipliers, field = forces_in_mode(mode, t, x)
    multipliers = multipliers_at_ends(mode, t, x, mode.contact, multipliers)
    still = [jnp.asarray(False) for _ in mode.jumps]
    if mode.slidable and mode.contact.shape[0]:
        held = slide_terms(mode, t, x).still
        for i, k in enumerate(mode.slidable):
            still[k] = held[i]
    own = switching_distances(mode, t, x)
    return field, Distances(gaps(mode, t, x), multipliers, own, jnp.stack(still))


def switched_rounding(mode: InMode, t, x, reach: State):
    """Return the rounding errors of the gaps, then of the distances from surfaces."""
    own = rounding_of(lambda s, y: switching_distances(mode, s, y), t, x, reach)
    gaps = gap_rounding(mode, t, x, reach)
    return jnp.concatenate([gaps, own]) if gaps.shape[0] else own
