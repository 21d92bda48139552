"""A system with the physics that it may lack."""

import equinox as eqx
import jax
import jax.numpy as jnp

from ...fitting import Turning
from ...hybrid import HybridSystem
from ._term import Motion, Term
from ._where import Where


class WithTerms(HybridSystem):
    """A system with one coordinate and one constraint, and terms added to it.

    **Arguments:**

    - `base`: the system; its state is position and velocity.
    - `terms`: what is added, each a `Term`. Without effect while strengths are zero.

    The gap becomes that of the base less the terms' `contact`, and the restitution
    coefficient that of the base times their `restitution`.
    """

    base: HybridSystem
    terms: tuple[Term, ...] = ()

    @property
    def state_names(self) -> tuple[str, ...]:  # pyright: ignore
        return self.base.state_names

    @property
    def state_units(self) -> tuple[str, ...]:  # pyright: ignore
        return self.base.state_units

    @property
    def period(self):
        return self.base.period

    @property
    def speed(self):
        """Of the drive (rad/s), where the base has one."""
        return self.base.speed  # pyright: ignore

    def prepared(self) -> "WithTerms":
        return eqx.tree_at(lambda s: s.base, self, self.base.prepared())

    def check(self) -> None:
        self.base.check()

    def motion(self, t, state) -> Motion:
        """What the terms see of a state."""
        return Motion(t, state[0], state[1], *_turned(self.base, t))

    def vector_field(self, t, state) -> jax.Array:
        rate = self.base.vector_field(t, state)
        motion = self.motion(t, state)
        for term in self._acting(Where.FLIGHT):
            rate = rate.at[1].add(term.acceleration(motion))
        return rate

    def gap(self, t, state) -> jax.Array:
        gap = self.base.gap(t, state)
        if self._acting(Where.CONTACT):
            gap = gap - self._raised(t)
        return gap

    def impact(self, t, state) -> jax.Array:
        raised, bouncing = self._acting(Where.CONTACT), self._acting(Where.IMPACT)
        if not raised and not bouncing:
            return self.base.impact(t, state)
        speed, push = self._normal(t, state)
        seen = state
        if raised:
            # the base knows nothing of the surface's additional rate
            _, rate = jax.jvp(self._raised, (t,), (jnp.ones_like(t),))
            seen = state - rate * push
            speed = speed - rate
        after = state + self.base.impact(t, seen) - seen
        if bouncing:
            landed = self.base.impact(t, seen)
            rebound, _ = self._normal(t, landed)
            motion, factor = self.motion(t, state), 1.0
            for term in bouncing:
                factor = factor * term.restitution(jnp.abs(speed), motion)
            after = after + (factor - 1) * rebound * push
        return after

    def _normal(self, t, state):
        """Normal velocity of the base, and the change of state that adds one to it."""
        one, none = jnp.ones_like(t), jnp.zeros_like(t)
        along = jnp.stack([one, none])
        _, slope = jax.jvp(lambda x: self.base.gap(t, x), (state,), (along,))
        field = jnp.stack([state[1], none])
        _, speed = jax.jvp(self.base.gap, (t, state), (one, field))
        return speed, jnp.stack([none, one]) / slope

    def _raised(self, t):
        none = jnp.zeros_like(t)
        motion = Motion(t, none, none, *_turned(self.base, t))
        total = none
        for term in self._acting(Where.CONTACT):
            total = total + term.contact(motion)
        return total

    def _acting(self, where: Where) -> list[Term]:
        return [term for term in self.terms if where in term.acts]


def _turned(base, t):
    """Angle (rad) and rate (rad/s) of the drive; time where there is no drive."""
    if hasattr(base, "speed") and hasattr(base, "phase"):
        return base.speed * t + base.phase, base.speed
    if base.period is not None:
        return 2 * jnp.pi * t / base.period, 2 * jnp.pi / base.period
    return t, jnp.ones_like(t)


def _speed(system):
    return system.base.speed


def _phase(system):
    return system.base.phase


_BASE_DRIVE = Turning(_speed, _phase)


def base_drive() -> Turning:
    """The measured drive of a base with fields `speed` and `phase`."""
    return _BASE_DRIVE
