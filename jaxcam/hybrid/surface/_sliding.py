"""Derive the motion relative to switching surfaces: crossing, sliding and its end.

While a motion slides on surfaces, its field is

    F = F_0 + sum_k b_k (F_k - F_0),

where F_0 is the branch on the sides from which the motion came, and F_k the branch
beyond surface k, with weights b such that the switching functions of all these surfaces
stay zero. On one surface, this is Filippov's convex combination. On several, it is
exact if the effects of the sides are additive, as those of several dry-friction forces
are. (A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, 1988,
section 4; R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical
Systems, 2004, chapter 4)

The distance from a surface is its switching function on the side of the motion, plus
its hysteresis. Like a gap, it is positive before and zero at a crossing. While the
motion slides, the distance is (b + s) (1 + s - b) instead, with s = (holding - 1) / 2:
sliding ends where this expression falls to zero.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._types import RealScalar, State
from ._contact_forces import contact_forces, contact_terms, Distances
from ._equal_slips import solve_equal_slips
from ._normal import along_path, gaps, motion_rates
from ._rounding import gap_rounding, rounding_of
from ._switches import OnSides, surfaces


# a contact holds the motion at a surface if the contact forces undo the change that the
# sides make, except for this fraction
_UNDONE = 1e-12


class Jumps(NamedTuple):
    """For each surface, the components of the field that its side changes; none if no
    motion can slide on it.
    """

    held: tuple[tuple[int, ...], ...] = ()
    """Components that change in contact, because of the branch or of friction."""
    free: tuple[tuple[int, ...], ...] = ()
    """Components that change without contacts, because of the branch."""


class InMode(OnSides):
    """A switched system in one mode: sides of surfaces, surfaces on which the motion
    slides, and contacts.
    """

    sliding: Bool[Array, " k"]
    """Whether the motion slides on each surface, shape `(k,)`."""
    contact: Bool[Array, " m"]
    """Which constraints are in contact, shape `(m,)`."""
    jumping: Jumps = eqx.field(static=True)
    """The components of the field that change at the surfaces."""

    def vector_field(self, t: RealScalar, state: State) -> State:
        """Return the rates of the branch, or of sliding, without contacts."""
        free = Jumps(self.jumping.free, self.jumping.free)
        none = self.contact[:0]
        mode = InMode(self.system, self.negative, self.sliding, none, free)
        if not mode.slidable:
            return super().vector_field(t, state)
        return _combined(mode, slide_terms(mode, t, state))

    @property
    def jumps(self) -> tuple[tuple[int, ...], ...]:
        """For each surface, the components of the field that its side changes."""
        return self.jumping.held

    @property
    def slidable(self) -> list[int]:
        """The surfaces on which a motion can slide."""
        return [k for k, changed in enumerate(self.jumps) if changed]

    def beyond(self, surface: int) -> OnSides:
        """Return the branch on the other side of one surface."""
        flags = [self.negative[k] for k in range(len(self.jumps))]
        flags[surface] = ~flags[surface]
        return OnSides(self.system, jnp.stack(flags))


class SlideTerms(NamedTuple):
    """The terms that determine sliding on the K surfaces where it is possible."""

    # switching functions on the side of the motion, and their rates there
    heights: Float[Array, " K"]
    slopes: Float[Array, " K"]
    # change of the field beyond each surface, and the changes of all slopes due to it
    kicks: Float[Array, "K n"]
    gains: Float[Array, "K K"]
    # whether the sides drive a motion that leaves the surface back to it
    firm: Bool[Array, " K"]
    # whether a contact holds the motion at rest there, whatever the sides are
    still: Bool[Array, " K"]
    # the field on the side from which the motion came
    field: Float[Array, " n"]
    # multipliers of the contacts there, and their changes beyond each surface
    multipliers: Float[Array, " m"]
    changes: Float[Array, "K m"]


@eqx.filter_jit
def slide_terms(mode: InMode, t, x) -> SlideTerms:
    """Return the terms of sliding, contact forces included.

    Compiled functions evaluate them in many places; as a program of its own, they are
    traced only once.
    """
    chosen = mode.slidable
    before = OnSides(mode.system, mode.negative)
    beyond = [mode.beyond(k) for k in chosen]

    sides = jnp.stack([side.signs for side in (before, *beyond)])
    own, *others = mode.system.branches(t, x, sides)
    kicks = jnp.stack(
        [_only(mode.jumps[k], other - own) for k, other in zip(chosen, others)]
    )

    def heights(s, y):
        values = mode.signs * surfaces(mode.system, s, y)
        return jnp.stack([values[k] for k in chosen])

    values, drift = jax.jvp(lambda s: heights(s, x), (t,), (jnp.ones_like(t),))
    gradient = jax.jacfwd(lambda y: heights(t, y))(x)
    gains, field = gradient @ kicks.T, own
    multipliers, changes = jnp.zeros((0,)), jnp.zeros((len(chosen), 0))
    largest, least = jnp.abs(_own(gains)), jnp.zeros(len(chosen))
    if mode.contact.shape[0]:
        terms = contact_terms(before, t, x)
        multipliers, field = contact_forces(before, t, x, mode.contact, terms)
        forces = [contact_forces(side, t, x, mode.contact, terms) for side in beyond]
        kicks = jnp.stack([each.field - field for each in forces])
        changes = jnp.stack([each.multipliers - multipliers for each in forces])
        least = _UNDONE * largest
        gains = gradient @ kicks.T
    slopes, returns = drift + gradient @ field, _returns(mode, gains, least)
    largest = jnp.maximum(jnp.abs(_own(gains)), jnp.abs(slopes))
    still = (least > 0) & (largest <= least)
    return SlideTerms(
        values,
        slopes,
        kicks,
        gains,
        returns > least,
        still,
        field,
        multipliers,
        changes,
    )


def _own(gains: Float[Array, "K K"]) -> Float[Array, " K"]:
    """Return the diagonal: the effect of each side on the slope of its own surface."""
    return jnp.stack([gains[k, k] for k in range(len(gains))])


def _returns(mode: InMode, gains: Float[Array, "K K"], least) -> Float[Array, " K"]:
    """Return the change of each slope due to the side of its own surface.

    If this change is not above `least`, return the change while the motion slides on
    the other surfaces, whose sides may drive it back instead.
    """
    own, number = _own(gains), len(gains)
    if number == 1:
        return own
    others, found = _slides_on(mode) & (own > least), []
    for k in range(number):
        kept = solve_equal_slips(gains, gains[:, k], others, 0.0)
        rest = own[k] - jnp.sum(jnp.where(others, gains[k] * kept, 0.0))
        found.append(jnp.where(own[k] > least[k], own[k], rest))
    return jnp.stack(found)


def _only(changed: tuple[int, ...], change: State) -> State:
    """Return the given components of a change of the field, zero elsewhere."""
    parts = [change[i] if i in changed else jnp.zeros(()) for i in range(len(change))]
    return jnp.stack(parts)


def shares(mode: InMode, terms: SlideTerms) -> Float[Array, " K"]:
    """Return the weight b of the branch beyond each surface, zero if the motion does
    not slide.
    """
    on = _slides_on(mode) & terms.firm
    return solve_equal_slips(terms.gains, -terms.slopes, on, 1.0)


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
    return total, _combined(mode, terms)


def _combined(mode: InMode, terms: SlideTerms) -> State:
    """Return the field of the branch plus its weighted changes beyond the surfaces."""
    parts, found = list(terms.field), shares(mode, terms)
    for kick, share, k in zip(terms.kicks, found, mode.slidable, strict=True):
        # through contact forces, a change may affect other components
        changed = range(len(parts)) if mode.contact.shape[0] else mode.jumps[k]
        for i in changed:
            more = jnp.where(mode.sliding[k], share * kick[i], 0.0)
            parts[i] = parts[i] + more
    return jnp.stack(parts)


def _slides_on(mode: InMode):
    return jnp.stack([mode.sliding[k] for k in mode.slidable])


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
    on = _slides_on(mode)
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
