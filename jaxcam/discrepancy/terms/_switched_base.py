"""Add terms and elements to systems with switching surfaces."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from ...hybrid import HybridSystem, SwitchedSystem, SwitchedWrapping
from ._hidden_elements import HiddenElement
from ._phase_sense import phase_sense
from ._term import Term
from ._with_hidden import WithHidden
from ._with_terms import WithTerms


class SwitchedWithTerms(WithTerms, SwitchedWrapping):
    """A switched system and terms added to each of its branches, except to velocities
    that a mode holds.

    The sides of the surfaces must not change the rates of the coordinates, only those
    of their velocities.
    """

    base: SwitchedSystem
    """The system."""

    def vector_field(self, t, state) -> jax.Array:
        return self.branch(t, state, self.sides(t, state))

    def branch(self, t, state, sides) -> jax.Array:
        field = self.base.branch(t, state, sides)
        return self.base.forced(field, self._pushed(t, state, field), sides)

    def branches(self, t, state, sides) -> jax.Array:
        fields = self.base.branches(t, state, sides)
        # forces change with the sides, velocities do not; a term that depends on the
        # motion alone is therefore evaluated only once
        own = fields[0]

        def pushed(field, sides):
            forces = self._pushed(t, state, field, own)
            return self.base.forced(field, forces, sides)

        return jax.vmap(pushed)(fields, sides)


class SwitchedWithHidden(WithHidden, SwitchedWrapping):
    """A switched system with an element that has an internal state; this state does not
    change at the switching surfaces.
    """

    base: SwitchedSystem
    """The system, a `SwitchedWithTerms` or any other."""

    def vector_field(self, t, state) -> jax.Array:
        return self.branch(t, state, self.sides(t, state))

    def switching(self, t, state):
        return self.base.switching(t, self._own(state))

    def distances(self, t, state, sides) -> jax.Array:
        return self.base.distances(t, self._own(state), sides)

    def branch(self, t, state, sides) -> jax.Array:
        field = self.base.branch(t, self._own(state), sides)
        return self._held(field, self._driven(state, field), sides)

    def branches(self, t, state, sides) -> jax.Array:
        fields = self.base.branches(t, self._own(state), sides)

        def driven(field, sides):
            return self._held(field, self._driven(state, field), sides)

        return jax.vmap(driven)(fields, sides)

    def _held(self, field, driven, sides) -> jax.Array:
        """Return the rates with the force of the element, unless a mode holds the
        body.
        """
        own = self.base.forced(field, self._own(driven), sides)
        return driven.at[: -self._size].set(own)

    def forced(self, rate, pushed, sides) -> jax.Array:
        return self._held(self._own(rate), pushed, sides)

    def sides(self, t, state):
        return self.base.sides(t, self._own(state))

    def contact_friction(self, t, state, sides):
        rows = self.base.contact_friction(t, self._own(state), sides)
        none = jnp.zeros((*rows.shape[:-1], self._size))
        return jnp.concatenate([rows, none], axis=-1)

    def reset(self, t, state, sides):
        return self._kept(state, self.base.reset(t, self._own(state), sides))


def system_with_terms(
    base: HybridSystem, terms: Sequence[Term], coordinates=((0, 1),), state=None
) -> WithTerms:
    """Return a system with terms added to it; any switching surfaces are kept.

    Args:
        base: The system.
        terms: The terms.
        coordinates: As in [`jaxcam.discrepancy.terms.WithTerms`][].
        state: A state of the motion, `(n,)`, at which it is tested whether the forcing
            has the field `phase` as its phase; without a state, terms that depend on
            the phase do not include it.

    Returns:
        The system with the terms.

    Examples:
        >>> from jaxcam.discrepancy.terms import system_with_terms
        >>> from jaxcam.models import BilinearOscillator
        >>> type(system_with_terms(BilinearOscillator(), ())).__name__
        'SwitchedWithTerms'
    """
    sense = 0 if state is None else phase_sense(base, state)
    if isinstance(base, SwitchedSystem):
        return SwitchedWithTerms(base, tuple(terms), coordinates, sense)
    return WithTerms(base, tuple(terms), coordinates, sense)


def system_with_element(
    base: HybridSystem, element: HiddenElement, coordinate: tuple[int, int]
) -> WithHidden:
    """Return a system with an element added to it; any switching surfaces are kept.

    Args:
        base: The system.
        element: The element.
        coordinate: As in [`jaxcam.discrepancy.terms.WithHidden`][].

    Returns:
        The system with the element.

    Examples:
        >>> from jaxcam.discrepancy.terms import Relaxation, system_with_element
        >>> from jaxcam.models import ImpactOscillator
        >>> type(system_with_element(ImpactOscillator(), Relaxation(), (0, 1))).__name__
        'WithHidden'
    """
    if isinstance(base, SwitchedSystem):
        return SwitchedWithHidden(base, element, coordinate)
    return WithHidden(base, element, coordinate)
