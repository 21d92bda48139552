"""A wooden woodpecker that hops down a pole."""

from typing import ClassVar

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
    """A bird on a spring whose sleeve slides, jams and swings on a pole.

    The state is (height, sleeve angle, bird angle) and their rates. The constraints are
    the beak, the lower edge of the sleeve and its upper edge; each touches the pole
    with friction. The switching functions are the slip velocities of the beak and of
    the sleeve. Gravity sustains the oscillation: the sleeve jams while the bird swings
    down and up, and slides while the sleeve turns over.

    C. Glocker, Dynamik von Starrkoerpersystemen mit Reibung und Stoessen, VDI (1995);
    R. I. Leine, C. Glocker and D. H. van Campen, Nonlinear dynamics of the woodpecker
    toy, ASME DETC (2001), VIB-21608. The default values are those of the references.

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
        "height_rate",
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

    sleeve_mass: jax.Array = parameter(3e-4)
    """Mass of the sleeve (kg)."""
    bird_mass: jax.Array = parameter(4.5e-3)
    """Mass of the bird (kg)."""
    sleeve_inertia: jax.Array = parameter(5e-9)
    """Moment of inertia of the sleeve (kg m^2)."""
    bird_inertia: jax.Array = parameter(7e-7)
    """Moment of inertia of the bird about its centre of mass (kg m^2)."""
    spring: jax.Array = parameter(5.6e-3)
    """Stiffness of the spring between them (N m/rad)."""
    pole_radius: jax.Array = parameter(2.5e-3)
    """Radius of the pole (m)."""
    sleeve_radius: jax.Array = parameter(3.1e-3)
    """Inner radius of the sleeve (m)."""
    sleeve_half_height: jax.Array = parameter(5.8e-3)
    """Half the height of the sleeve (m)."""
    spring_distance: jax.Array = parameter(0.010)
    """Horizontal distance from the sleeve's centre of mass to the spring (m)."""
    bird_distance: jax.Array = parameter(0.015)
    """Horizontal distance from the spring to the bird's centre of mass (m)."""
    beak_height: jax.Array = parameter(0.02)
    """Vertical distance from the bird's centre of mass to the beak (m)."""
    beak_distance: jax.Array = parameter(0.0201)
    """Horizontal distance from the bird's centre of mass to the beak (m)."""
    beak_restitution: jax.Array = parameter(0.5)
    """Coefficient of restitution of the beak, between 0 and 1."""
    sleeve_restitution: jax.Array = parameter(0.0)
    """Coefficient of restitution of both edges of the sleeve, between 0 and 1."""
    friction_coefficient: jax.Array = parameter(0.3)
    """Coefficient of friction of all contacts."""
    gravity: jax.Array = parameter(9.81)
    """Acceleration due to gravity (m/s^2)."""

    def switching(self, t, state) -> jax.Array:
        """Return the slip velocities of the beak and of the sleeve (m/s)."""
        del t
        return jnp.stack([row @ state[3:] for row in self._tangents()])

    def branch(self, t, state, sides) -> jax.Array:
        """Return the rates without contact, shape `(6,)`."""
        del t, sides
        weight = -self.gravity * self.bird_mass
        twist = self.spring * (state[2] - state[1])
        forces = jnp.stack(
            [
                weight - self.gravity * self.sleeve_mass,
                weight * self.spring_distance + twist,
                weight * self.bird_distance - twist,
            ]
        )
        return jnp.concatenate([state[3:], self._flexibility() @ forces])

    def gap(self, t, state) -> jax.Array:
        """Return the gaps of the beak and of the lower and the upper edge of the sleeve
        (m), shape `(3,)`.
        """
        del t
        width = self.spring_distance + self.bird_distance - self.beak_distance
        play = self.sleeve_radius - self.pole_radius
        tilt = self.sleeve_half_height * state[1]
        beak = width - self.pole_radius - self.beak_height * state[2]
        return jnp.stack([beak, play + tilt, play - tilt])

    def impact(self, t, state) -> jax.Array:
        """Return the states after impacts without friction, shape `(3, 6)`."""
        del t
        flexibility = self._flexibility()
        beak, edge = self.beak_restitution, self.sleeve_restitution
        rows = []
        for normal, restitution in zip(self._normals(), (beak, edge, edge)):
            moved = flexibility @ normal
            impulse = -(1 + restitution) * (normal @ state[3:]) / (normal @ moved)
            rows.append(state.at[3:].add(impulse * moved))
        return jnp.stack(rows)

    def contact_friction(self, t, state, sides) -> jax.Array:
        """Return the friction per unit of the normal acceleration, shape `(3, 6)`."""
        del t
        flexibility = self._flexibility()
        beak, sleeve = (side * row for side, row in zip(sides, self._tangents()))
        rows = []
        for normal, tangent in zip(self._normals(), (beak, sleeve, sleeve)):
            push = -self.friction_coefficient / (normal @ flexibility @ normal)
            rows.append(jnp.zeros_like(state).at[3:].set(push * flexibility @ tangent))
        return jnp.stack(rows)

    def check(self) -> None:
        """Raise `ValueError` if a parameter has no physical meaning."""
        require_positive(
            sleeve_mass=self.sleeve_mass,
            bird_mass=self.bird_mass,
            sleeve_inertia=self.sleeve_inertia,
            bird_inertia=self.bird_inertia,
            spring=self.spring,
            sleeve_half_height=self.sleeve_half_height,
            beak_height=self.beak_height,
        )
        require_restitution(self.beak_restitution)
        require_restitution(self.sleeve_restitution)
        require_not_negative(friction_coefficient=self.friction_coefficient)

    def _normals(self):
        """Return the gradients of the gaps with respect to the coordinates."""
        zero, half = 0.0 * self.beak_height, self.sleeve_half_height
        beak = jnp.stack([zero, zero, -self.beak_height])
        return beak, jnp.stack([zero, half, zero]), jnp.stack([zero, -half, zero])

    def _tangents(self):
        """Return the slip velocities per unit of the rates of the coordinates."""
        one, zero = 1.0 + 0.0 * self.sleeve_radius, 0.0 * self.sleeve_radius
        across = self.bird_distance - self.beak_distance
        beak = jnp.stack([one, self.spring_distance, across])
        return beak, jnp.stack([one, self.sleeve_radius, zero])

    def _flexibility(self) -> jax.Array:
        """Return the inverse of the mass matrix, shape `(3, 3)`."""
        m, a, b = self.bird_mass, self.spring_distance, self.bird_distance
        total = m + self.sleeve_mass
        p, q, r = m * a, m * b, m * a * b
        u, v = self.sleeve_inertia + m * a * a, self.bird_inertia + m * b * b
        minors = (u * v - r * r, q * r - p * v, p * r - q * u)
        rest = (total * v - q * q, p * q - total * r, total * u - p * p)
        determinant = total * minors[0] + p * minors[1] + q * minors[2]
        rows = (
            minors,
            (minors[1], rest[0], rest[1]),
            (minors[2], rest[1], rest[2]),
        )
        return jnp.stack([jnp.stack(row) for row in rows]) / determinant
