"""Derive the motion relative to switching surfaces: crossing, sliding and its end.

While a motion slides on surfaces, its field is

    F = F_0 + sum_k b_k (F_k - F_0),

where F_0 is the branch on the sides from which it came and F_k the branch beyond
surface k, with shares b such that the switching functions of all of them stay zero. On
one surface this is Filippov's convex combination. On several, it is exact where the
effects of the sides add up, as those of several dry-friction forces do. (A. F.
Filippov, Differential Equations with Discontinuous Righthand Sides, 1988, section 4; R.
I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
2004, chapter 4)

The distance of a surface is its switching function on the side of the motion, plus its
hysteresis: positive before a crossing, zero at it, as a gap is at an impact. While the
motion slides, the distance is (b + s) (1 + s - b) instead, with s = (holding - 1) / 2:
sliding ends where it falls to zero.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._types import RealScalar, State
from ._masked import solve_masked
from ._normal import contact_multipliers, field_in_force, jet_along, lie_series
from ._rounding import gap_rounding, rounding_of
from ._switches import OnSides, surfaces


# a surface is held by a contact if the contact forces undo this fraction of the change
# that its sides make
_UNDONE = 1e-12


class InMode(OnSides):
    """A switched system in one mode: sides of surfaces, and surfaces that it slides
    on.
    """

    sliding: Bool[Array, " k"]
    """Whether the motion slides on each surface, shape `(k,)`."""
    contact: Bool[Array, " m"]
    """Which constraints are in contact, shape `(m,)`."""
    jumps: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    """For each surface, the components of the field that its side changes; empty if no
    motion can slide on it."""

    def vector_field(self, t: RealScalar, state: State) -> State:
        """Return the rates of the branch, or of sliding."""
        if not self.slidable:
            return super().vector_field(t, state)
        free = eqx.tree_at(lambda mode: mode.contact, self, self.contact[:0])
        return _combined(free, slide_terms(free, t, state))

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
    # change of the field beyond each surface, and of the rates of all heights by it
    kicks: Float[Array, "K n"]
    gains: Float[Array, "K K"]
    # whether the sides drive the motion to the surface when it leaves it
    firm: Bool[Array, " K"]
    # whether a contact holds the motion at rest there, whatever the sides
    still: Bool[Array, " K"]
    # the field on the side from which the motion came
    field: Float[Array, " n"]


def slide_terms(mode: InMode, t, x) -> SlideTerms:
    """Return the terms of sliding, contact forces included."""
    chosen = mode.slidable
    before = OnSides(mode.system, mode.negative)
    free = before.vector_field(t, x)
    beyond = [mode.beyond(k) for k in chosen]
    changes = [side.vector_field(t, x) - free for side in beyond]
    kicks = [
        jnp.stack(
            [d[i] if i in mode.jumps[k] else jnp.zeros(()) for i in range(len(x))]
        )
        for k, d in zip(chosen, changes, strict=True)
    ]

    def heights(s, y):
        values = mode.signs * surfaces(mode.system, s, y)
        return jnp.stack([values[k] for k in chosen])

    def gains_of(kicks):
        columns = [
            jax.jvp(heights, (t, x), (jnp.zeros_like(t), kick))[1] for kick in kicks
        ]
        return jnp.stack(columns, axis=1)

    gains, field = gains_of(kicks), free
    number = range(len(chosen))
    own = jnp.stack([gains[i, i] for i in number])
    least = jnp.zeros_like(own)
    if mode.contact.shape[0]:
        field = field_in_force(before, t, x, mode.contact)
        kicks = [field_in_force(side, t, x, mode.contact) - field for side in beyond]
        gains, least = gains_of(kicks), _UNDONE * jnp.abs(own)
        own = jnp.stack([gains[i, i] for i in number])
    values, slopes = jax.jvp(heights, (t, x), (jnp.ones_like(t), field))
    largest = jnp.maximum(jnp.abs(own), jnp.abs(slopes))
    still = (least > 0) & (largest <= least)
    kicks = jnp.stack(kicks)
    return SlideTerms(values, slopes, kicks, gains, own > least, still, field)


def shares(mode: InMode, terms: SlideTerms) -> Float[Array, " K"]:
    """Return the weight b of the branch beyond each surface, zero if it does not
    slide.
    """
    return solve_masked(terms.gains, -terms.slopes, _slides_on(mode) & terms.firm)


def field_in_mode(mode: InMode, t, x, contact: Bool[Array, " m"]) -> State:
    """Return the field of free flight, contact or sliding, as `field_in_force`."""
    if not mode.slidable:
        return field_in_force(mode, t, x, contact)
    return _combined(mode, slide_terms(mode, t, x))


def multipliers_in_mode(mode: InMode, t, x, contact: Bool[Array, " m"]):
    """Return the multipliers of the constraints, as `contact_multipliers`.

    Like the field, they are those of the branch and the weights of their changes.
    """
    if not mode.slidable:
        return contact_multipliers(mode, t, x, contact)
    found = shares(mode, slide_terms(mode, t, x))
    own = contact_multipliers(OnSides(mode.system, mode.negative), t, x, contact)
    total = own
    for share, k in zip(found, mode.slidable, strict=True):
        change = contact_multipliers(mode.beyond(k), t, x, contact) - own
        total = total + jnp.where(mode.sliding[k], share * change, 0.0)
    return total


def _combined(mode: InMode, terms: SlideTerms) -> State:
    """Return the field of the branch and the weights of its changes."""
    parts, found = list(terms.field), shares(mode, terms)
    for kick, share, k in zip(terms.kicks, found, mode.slidable, strict=True):
        # contact forces pass a change on to other components
        changed = range(len(parts)) if mode.contact.shape[0] else mode.jumps[k]
        for i in changed:
            more = jnp.where(mode.sliding[k], share * kick[i], 0.0)
            parts[i] = parts[i] + more
    return jnp.stack(parts)


def _slides_on(mode: InMode):
    return jnp.stack([mode.sliding[k] for k in mode.slidable])


def _of_each(value, mode: OnSides) -> Float[Array, " k"]:
    """Return a number of a system as one for each surface."""
    return jnp.broadcast_to(jnp.asarray(value, dtype=jnp.float64), mode.negative.shape)


def slack_of_hold(mode: OnSides) -> Float[Array, " k"]:
    """Return s = (holding - 1) / 2 of each surface."""
    return (_of_each(mode.system.holding, mode) - 1.0) / 2


def distances(mode: InMode, t, x) -> Float[Array, " k"]:
    """Return the distance of each surface, zero at a crossing or at the end of sliding,
    shape `(k,)`.
    """
    open_ones = mode.signs * surfaces(mode.system, t, x) + mode.system.hysteresis
    if not mode.slidable:
        return open_ones
    terms = slide_terms(mode, t, x)
    found, slack = shares(mode, terms), slack_of_hold(mode)
    rows = [open_ones[k] for k in range(len(mode.jumps))]
    for i, k in enumerate(mode.slidable):
        left = (found[i] + slack[k]) * (1 + slack[k] - found[i])
        # both branches drive the motion away from the surface
        left = jnp.where(terms.firm[i], left, -1.0)
        rows[k] = jnp.where(mode.sliding[k], left, rows[k])
    return jnp.stack(rows)


def beyond_shares(mode: InMode, t, x) -> Float[Array, " k"]:
    """Return the weight of the branch beyond each surface, shape `(k,)`; zero where the
    motion does not slide.
    """
    found = list(shares(mode, slide_terms(mode, t, x)))
    zero = jnp.zeros_like(t)
    places = {k: share for k, share in zip(mode.slidable, found, strict=True)}
    return jnp.stack([places.get(k, zero) for k in range(len(mode.jumps))])


def settled(mode: InMode, t, x) -> Float[Array, "rows n"]:
    """Return the state moved onto the surfaces on which it slides, by one Newton step,
    then the change of the field beyond each, zero where it does not slide.

    The state moves in the directions in which the field jumps, as it does over a short
    time of sliding: a velocity is corrected by the friction that holds it.
    """
    terms = slide_terms(mode, t, x)
    on = _slides_on(mode)
    lengths = solve_masked(terms.gains, terms.heights, on & terms.firm)
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


def switched_jet(mode: InMode, t, x, contact: Bool[Array, " m"]):
    """Return distance and three rates of each constraint, then of each surface.

    Shape `(m + k, 4)`; for a constraint in contact as `mode_jet`.
    """

    def field(s, y):
        return field_in_mode(mode, s, y, contact)

    def multiplier(s, y):
        return multipliers_in_mode(mode, s, y, contact)

    along = lie_series(lambda s, y: distances(mode, s, y), field, 3)(t, x)
    own = jnp.stack(along, axis=1)
    if not contact.shape[0]:
        return own
    gaps = jet_along(mode, t, x, contact, field, multiplier)
    return jnp.concatenate([gaps, _still(mode, t, x, own)])


def _still(mode: InMode, t, x, jets):
    """Remove the rates at surfaces where a contact holds the motion: rounding."""
    if not mode.slidable:
        return jets
    still, rows = slide_terms(mode, t, x).still, list(jets)
    for i, k in enumerate(mode.slidable):
        at_rest = jnp.concatenate([rows[k][:1], jnp.zeros_like(rows[k][1:])])
        rows[k] = jnp.where(still[i], at_rest, rows[k])
    return jnp.stack(rows)


def switched_rounding(mode: InMode, t, x, reach: State):
    """Return the rounding errors of the gaps, then of the distances of surfaces."""
    own = rounding_of(lambda s, y: distances(mode, s, y), t, x, reach)
    gaps = gap_rounding(mode, t, x, reach)
    return jnp.concatenate([gaps, own]) if gaps.shape[0] else own
