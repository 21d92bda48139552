"""A toy woodpecker that pecks its way down a bar."""

from typing import ClassVar, Literal

import jax
import jax.numpy as jnp

from ..hybrid import SwitchedSystem
from ._parameters import (
    parameter,
    require_not_negative,
    require_positive,
    require_restitution,
)


class WoodpeckerToy(SwitchedSystem):
    """A sleeve on a vertical bar, and a bird attached to the sleeve by a spring.

    The sleeve is wider than the bar: it tilts, jams at its upper or lower edge and
    holds the toy by friction, until the swinging bird frees it and the toy slides down.
    At the end of each swing, the beak of the bird hits the bar.

    The state is (height of the sleeve, its angle, angle of the bird, and their
    velocities); a positive angle of the bird moves the beak towards the bar. The first
    constraint is the beak; the others are the lower and the upper edge of the sleeve.
    The beak has the coefficient of restitution `restitution`, and the edges do not
    bounce; all three have the coefficient of friction `friction_coefficient`. The
    height does not influence the motion.

    The default values are those of Glocker's toy. The first simulation in a process
    takes about a minute to compile, unless its program is in JAX's cache on disk.

    C. Glocker, Dynamik von Starrkörpersystemen mit Reibung und Stössen, thesis, TU
    München (1995), pp. 162 ff.; R. I. Leine, D. H. van Campen, C. Glocker, Nonlinear
    dynamics and modeling of various wooden toys with impact and friction, Journal of
    Vibration and Control 9 (2003).

    Examples:
        >>> from jaxcam.models import WoodpeckerToy
        >>> toy = WoodpeckerToy()
        >>> toy.gap(0.0, jnp.zeros(6)).round(6).tolist()
        [0.0024, 0.0006, 0.0006]
    """

    state_names: ClassVar[tuple[str, ...]] = (
        "height",
        "sleeve_angle",
        "bird_angle",
        "velocity",
        "sleeve_rate",
        "bird_rate",
    )
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = (
        "m",
        "rad",
        "rad",
        "m/s",
        "rad/s",
        "rad/s",
    )
    """Units of the state components."""
    constraint_names: ClassVar[tuple[str, ...]] = ("beak", "lower edge", "upper edge")
    """Names of the constraints."""

    sleeve_mass: jax.Array = parameter(3e-4)
    """Mass of the sleeve (kg)."""
    sleeve_inertia: jax.Array = parameter(5e-9)
    """Moment of inertia of the sleeve about its centre (kg m^2)."""
    bird_mass: jax.Array = parameter(4.5e-3)
    """Mass of the bird (kg)."""
    bird_inertia: jax.Array = parameter(7e-7)
    """Moment of inertia of the bird about its centre (kg m^2)."""
    bar_radius: jax.Array = parameter(2.5e-3)
    """Radius of the bar (m)."""
    sleeve_radius: jax.Array = parameter(3.1e-3)
    """Inner radius of the sleeve (m)."""
    sleeve_height: jax.Array = parameter(5.8e-3)
    """Half the height of the sleeve (m)."""
    spring_offset: jax.Array = parameter(0.01)
    """Horizontal distance from the centre of the sleeve to the spring (m)."""
    bird_offset: jax.Array = parameter(0.015)
    """Horizontal distance from the spring to the centre of the bird (m)."""
    beak_height: jax.Array = parameter(0.02)
    """Height of the beak above the centre of the bird (m)."""
    beak_length: jax.Array = parameter(0.0201)
    """Horizontal distance from the centre of the bird to its beak (m)."""
    stiffness: jax.Array = parameter(5.6e-3)
    """Stiffness of the spring (N m/rad)."""
    friction_coefficient: jax.Array = parameter(0.3)
    """Coefficient of friction at the beak and at both edges."""
    restitution: jax.Array = parameter(0.5)
    """Coefficient of restitution of the beak, between 0 and 1."""
    gravity: jax.Array = parameter(9.81)
    """Acceleration due to gravity (m/s^2)."""

    @property
    def restitution_kind(self) -> Literal["complementarity"]:
        """Return the law of the cited papers: see
        [`SwitchedSystem.restitution_kind`][jaxcam.hybrid.SwitchedSystem].
        """
        return "complementarity"

    def branch(self, t, state, sides) -> jax.Array:
        """Return the velocities and accelerations without contact, shape `(6,)`."""
        del t, sides
        _, sleeve, bird, *velocities = state
        twist = self.stiffness * (bird - sleeve)
        weight = self.bird_mass * self.gravity
        forces = jnp.stack(
            [
                -(self.bird_mass + self.sleeve_mass) * self.gravity,
                twist - weight * self.spring_offset,
                -twist - weight * self.bird_offset,
            ]
        )
        return jnp.concatenate([jnp.stack(velocities), self._inverse @ forces])

    def switching(self, t, state) -> jax.Array:
        """Return the slip velocities of the beak and of the edges (m/s), shape
        `(2,)`.
        """
        del t
        return self._slips @ state[3:]

    def gap(self, t, state) -> jax.Array:
        """Return the distances of the beak and of the lower and upper edge of the
        sleeve from the bar (m), shape `(3,)`.
        """
        del t
        reach = self.spring_offset + self.bird_offset - self.beak_length
        free = jnp.stack([reach, self.sleeve_radius, self.sleeve_radius])
        return free - self.bar_radius + self._normals @ state[:3]

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact without friction at each constraint, shape
        `(3, 6)`.
        """
        del t
        none = jnp.zeros_like(self.restitution)
        after = []
        for normal, held in zip(
            self._normals, (self.restitution, none, none), strict=True
        ):
            direction = self._inverse @ normal
            impulse = (1 + held) * (normal @ state[3:]) / (normal @ direction)
            after.append(jnp.concatenate([state[:3], state[3:] - impulse * direction]))
        return jnp.stack(after)

    def contact_friction(self, t, state, sides) -> jax.Array:
        """Return the friction of each constraint per unit of its normal acceleration,
        shape `(3, 6)`.
        """
        del t
        rows = []
        for normal, surface in zip(self._normals, (0, 1, 1), strict=True):
            direction = self._inverse @ self._slips[surface]
            scale = normal @ self._inverse @ normal
            push = -self.friction_coefficient * sides[surface] * direction / scale
            rows.append(jnp.concatenate([jnp.zeros_like(state[:3]), push]))
        return jnp.stack(rows)

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(
            sleeve_mass=self.sleeve_mass,
            sleeve_inertia=self.sleeve_inertia,
            bird_mass=self.bird_mass,
            bird_inertia=self.bird_inertia,
            bar_radius=self.bar_radius,
            clearance=self.sleeve_radius - self.bar_radius,
            sleeve_height=self.sleeve_height,
            beak_height=self.beak_height,
            stiffness=self.stiffness,
            gravity=self.gravity,
        )
        require_not_negative(friction_coefficient=self.friction_coefficient)
        require_restitution(self.restitution)

    @property
    def _normals(self) -> jax.Array:
        """Gradients of the gaps with respect to the positions, shape `(3, 3)`."""
        zero = jnp.zeros_like(self.beak_height)
        return jnp.stack(
            [
                jnp.stack([zero, zero, -self.beak_height]),
                jnp.stack([zero, self.sleeve_height, zero]),
                jnp.stack([zero, -self.sleeve_height, zero]),
            ]
        )

    @property
    def _slips(self) -> jax.Array:
        """Matrix that maps the velocities to the slip velocities, shape `(2, 3)`."""
        one = jnp.ones_like(self.beak_height)
        behind = self.bird_offset - self.beak_length
        return jnp.stack(
            [
                jnp.stack([one, self.spring_offset, behind]),
                jnp.stack([one, self.sleeve_radius, 0 * one]),
            ]
        )

    @property
    def _inverse(self) -> jax.Array:
        """Inverse of the mass matrix, shape `(3, 3)`, computed from its cofactors."""
        bird, first, second = self.bird_mass, self.spring_offset, self.bird_offset
        a, b, c = self.sleeve_mass + bird, bird * first, bird * second
        d, e = self.sleeve_inertia + bird * first**2, bird * first * second
        f = self.bird_inertia + bird * second**2
        cofactors = jnp.stack(
            [
                jnp.stack([d * f - e * e, c * e - b * f, b * e - c * d]),
                jnp.stack([c * e - b * f, a * f - c * c, b * c - a * e]),
                jnp.stack([b * e - c * d, b * c - a * e, a * d - b * b]),
            ]
        )
        return cofactors / (jnp.stack([a, b, c]) @ cofactors[0])
