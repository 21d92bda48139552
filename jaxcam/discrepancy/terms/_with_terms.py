"""A system with terms for the physics that it may lack."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from ...fitting import Turning
from ...hybrid import HybridSystem, Wrapping
from ._free_function import prepared_terms
from ._term import EVERY, Motion, Term
from ._where import Where


class WithTerms(Wrapping):
    """A system with terms added to it.

    The `contact` of a term is subtracted from the gap of its `constraint`, and its
    `restitution` multiplies the coefficient of restitution there.
    """

    base: HybridSystem
    """The system."""
    terms: tuple[Term, ...] = ()
    """Terms added to the system; they have no effect while their strengths are zero."""
    coordinates: tuple[tuple[int, int], ...] = eqx.field(
        default=((0, 1),), static=True, metadata={"spare": True}
    )
    """For each coordinate, the state components of the coordinate and of its velocity.
    The force of a term acts on its `coordinate`.
    """

    sense: int = eqx.field(default=0, static=True, metadata={"spare": True})
    """The result of `phase_sense` for the base."""

    @property
    def inner(self) -> HybridSystem:
        return self.base

    @property
    def speed(self):
        """Speed of the drive (rad/s), if the base has one."""
        return self.base.speed  # pyright: ignore

    @property
    def steep(self) -> bool:  # pyright: ignore
        return self.inner.steep or any(term.corner for term in self.terms)

    def prepared(self) -> "WithTerms":
        new = self.base.prepared(), prepared_terms(self.terms)
        return eqx.tree_at(lambda s: (s.base, s.terms), self, new)

    def motion(self, t, state, coordinate: int = 0, field=None, moving=None) -> Motion:
        """Return the motion at which the terms of a coordinate are evaluated.

        Args:
            field: Rate of change of the state, if known.
            moving: Rate of change of the state from which the velocity is taken; it may
                be evaluated on other sides of the switching surfaces than `field`,
                because the velocities are the same there. Default: `field`.
        """
        place, rate = self.coordinates[coordinate]
        moving = field if moving is None else moving
        velocity = state[rate] if moving is None else moving[place]
        pushed = 0.0 if field is None else field[rate]
        turned = drive_at(self, t)
        return Motion(t, state[place], velocity, *turned, state, pushed)

    def vector_field(self, t, state) -> jax.Array:
        return self._pushed(t, state, self.base.vector_field(t, state))

    def _pushed(self, t, state, field, moving=None) -> jax.Array:
        """Return the field of the base with the forces of the terms.

        **Arguments:** `field` and `moving` as for `motion`.
        """
        rate = field
        for term in self._acting(Where.FLIGHT):
            motion = self.motion(t, state, term.coordinate, field, moving)
            pushed = self.coordinates[term.coordinate][1]
            rate = rate.at[pushed].add(term.acceleration(motion))
        return rate

    def gap(self, t, state) -> jax.Array:
        gap = self.base.gap(t, state)
        if not gap.size:
            return gap
        for number in range(gap.size):
            if self._acting(Where.CONTACT, number):
                raised = self._raised(t, number)
                gap = gap - raised if gap.ndim == 0 else gap.at[number].add(-raised)
        return gap

    def impact(self, t, state) -> jax.Array:
        after = self.base.impact(t, state)
        changed = {*self._numbers(Where.CONTACT), *self._numbers(Where.IMPACT)}
        if not changed or not after.size:
            return after
        if after.ndim == 1:
            return self._landed(t, state, 0)
        return jnp.stack(
            [
                self._landed(t, state, k) if {k, EVERY} & changed else after[k]
                for k in range(after.shape[0])
            ]
        )

    def _landed(self, t, state, number: int):
        """Return the state after an impact on one constraint, with the terms that act
        there.
        """

        def law(x):
            after = self.base.impact(t, x)
            return after if after.ndim == 1 else after[number]

        speed, push = self._normal(t, state, number)
        seen = state
        if self._acting(Where.CONTACT, number):
            # the base does not include the additional velocity of the surface
            _, rate = jax.jvp(
                lambda t: self._raised(t, number), (t,), (jnp.ones_like(t),)
            )
            seen = state - rate * push
            speed = speed - rate
        landed = law(seen)
        after = state + landed - seen
        bouncing = self._acting(Where.IMPACT, number)
        if bouncing:
            rebound, _ = self._normal(t, landed, number)
            factor = 1.0
            for term in bouncing:
                field = self.base.vector_field(t, state)
                motion = self.motion(t, state, term.coordinate, field)
                factor = factor * term.restitution(jnp.abs(speed), motion)
            if len(self.coordinates) > 1:
                # the impulse is distributed among the bodies: its direction is the
                # change of state that the impact law gives for unit normal velocity,
                # scaled to unit change of normal velocity
                _, kept = jax.jvp(law, (seen,), (push,))
                taken = push - kept
                push = taken / self._along(t, state, number, taken)
            after = after + (factor - 1) * rebound * push
        return after

    def _normal(self, t, state, number: int):
        """Return the normal velocity of the base, and the change of state that
        increases it by one.
        """
        slopes = self._slopes(t, state, number)
        one = jnp.ones_like(t)
        _, rate = jax.jvp(lambda t: self._gap_of(t, state, number), (t,), (one,))
        field = self.base.vector_field(t, state)
        speed = rate + sum(
            slope * field[place] for (place, _), slope in zip(self.coordinates, slopes)
        )
        size = sum(slope**2 for slope in slopes)
        push = jnp.zeros_like(state)
        for (_, place), slope in zip(self.coordinates, slopes):
            # if the gap does not move, there is no impact
            push = push.at[place].set(slope / jnp.where(size > 0, size, 1.0))
        return speed, push

    def _along(self, t, state, number: int, change):
        """Return the change of normal velocity due to a change of state."""
        slopes = self._slopes(t, state, number)
        return sum(
            slope * change[place] for (_, place), slope in zip(self.coordinates, slopes)
        )

    def _slopes(self, t, state, number: int):
        """Return the derivatives of the gap with respect to the coordinates."""
        found = []
        for place, _ in self.coordinates:
            along = jnp.zeros_like(state).at[place].set(1.0)
            gap = jax.jvp(lambda x: self._gap_of(t, x, number), (state,), (along,))
            found.append(gap[1])
        return found

    def _gap_of(self, t, state, number: int):
        return jnp.atleast_1d(self.base.gap(t, state))[number]

    def _raised(self, t, number: int):
        none = jnp.zeros_like(t)
        motion = Motion(t, none, none, *drive_at(self, t))
        total = none
        for term in self._acting(Where.CONTACT, number):
            total = total + term.contact(motion)
        return total

    def _numbers(self, where: Where) -> list[int]:
        """Return the constraints on which terms act, `EVERY` among them."""
        return sorted({term.constraint for term in self._acting(where)})

    def _acting(self, where: Where, number: int | None = None) -> list[Term]:
        return [
            term
            for term in self.terms
            if where in term.acts and (number is None or term.acts_at(number))
        ]


def drive_at(system: WithTerms, t):
    """Return the angle (rad) and speed (rad/s) of the drive; without a drive, time and
    one.

    The angle of a periodic forcing contains the field `phase` of the base if `sense` is
    not zero.
    """
    base: Any = system.base
    if hasattr(base, "speed") and hasattr(base, "phase"):
        return base.speed * t + base.phase, base.speed
    if base.period is not None:
        rate = 2 * jnp.pi / base.period
        return rate * t + (system.sense * base.phase if system.sense else 0.0), rate
    return t, jnp.ones_like(t)


def _speed(system):
    return system.base.speed


def _phase(system):
    return system.base.phase


_BASE_DRIVE = Turning(_speed, _phase)


def base_drive() -> Turning:
    """Return the measured drive of a base with fields `speed` and `phase`."""
    return _BASE_DRIVE
