"""The mode of a switched system, and the terms that determine how it slides.

While a motion slides on surfaces, its field is

    F = F_0 + sum_k b_k (F_k - F_0),

where F_0 is the branch on the sides from which the motion came, and F_k the branch
beyond surface k, with weights b such that the switching functions of all these surfaces
stay zero. On one surface, this is Filippov's convex combination. On several, it is
exact if the effects of the sides are additive, as those of several dry-friction forces
are; the friction of several contacts with the same slip velocity is corrected for
(`_turned_together.py`). (A. F. Filippov, Differential Equations with Discontinuous
Righthand Sides, 1988, section 4; R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations
of Non-Smooth Mechanical Systems, 2004, chapter 4)
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._types import RealScalar, State
from ._contact_forces import contact_forces, contact_terms, ContactForces
from ._contact_friction import has_friction
from ._equal_slips import solve_equal_slips, ties
from ._switches import OnSides, surfaces
from ._turned_together import Turned, turned_together


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
        return combined(mode, slide_terms(mode, t, state))

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
        if len(chosen) > 1 and has_friction(mode.system):

            def forces_on(flags):
                side = OnSides(mode.system, flags)
                return contact_forces(side, t, x, mode.contact, terms)

            (multipliers, field), (changes, kicks) = turned_together(
                mode.negative,
                chosen,
                ties(gains, slides_on(mode)),
                forces_on,
                Turned(
                    ContactForces(multipliers, field), ContactForces(changes, kicks)
                ),
            )
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
    others, found = slides_on(mode) & (own > least), []
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
    on = slides_on(mode) & terms.firm
    return solve_equal_slips(terms.gains, -terms.slopes, on, 1.0)


def combined(mode: InMode, terms: SlideTerms) -> State:
    """Return the field of the branch plus its weighted changes beyond the surfaces."""
    parts, found = list(terms.field), shares(mode, terms)
    for kick, share, k in zip(terms.kicks, found, mode.slidable, strict=True):
        # through contact forces, a change may affect other components
        changed = range(len(parts)) if mode.contact.shape[0] else mode.jumps[k]
        for i in changed:
            more = jnp.where(mode.sliding[k], share * kick[i], 0.0)
            parts[i] = parts[i] + more
    return jnp.stack(parts)


def slides_on(mode: InMode) -> Bool[Array, " K"]:
    """Return whether the motion slides on each of the `slidable` surfaces."""
    return jnp.stack([mode.sliding[k] for k in mode.slidable])
