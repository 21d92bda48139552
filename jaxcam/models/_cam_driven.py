"""Common parts of systems with a follower on a cam of constant speed."""

from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import require_restitution
from .cams import CamProfile


_System = TypeVar("_System", bound="AbstractCamDriven")


class AbstractCamDriven(HybridSystem):
    """A follower on a cam of constant speed; its state is (position, velocity)."""

    profile: eqx.AbstractVar[CamProfile]
    speed: eqx.AbstractVar[jax.Array]
    phase: eqx.AbstractVar[jax.Array]
    restitution: eqx.AbstractVar[eqx.Module]

    def cam_angle(self, t) -> jax.Array:
        """Return the cam angle (rad) at `t` (s), elementwise."""
        return self.speed * t + self.phase

    @property
    def cam_velocity(self) -> jax.Array:
        """Rate of change of the cam angle (rad/s)."""
        return self.speed

    def after_impact(self, t, state) -> jax.Array:
        """Return the state after an impact on the cam, in which the relative velocity v
        becomes -r v.
        """
        cam = (self.cam_angle(t),), (self.cam_velocity,)
        _, moved = jax.jvp(self.profile, *cam)
        velocity = state[1] - moved
        r = self.restitution(self.speed, jnp.abs(velocity))  # pyright: ignore
        return jnp.stack([state[0], state[1] - (1 + r) * velocity])

    @property
    def period(self) -> jax.Array:
        """Duration of one turn of the cam (s)."""
        return 2 * jnp.pi / self.speed

    def prepared(self: _System) -> _System:
        """Return the same system with a profile that is cheaper to evaluate."""
        return eqx.tree_at(lambda s: s.profile, self, self.profile.prepared())

    def check_cam(self) -> None:
        """Raise `ValueError` for an invalid profile or restitution."""
        unit = self.state_units[1]
        for approach_speed in (0.0, 1.0):
            r = self.restitution(self.speed, jnp.asarray(approach_speed))  # pyright: ignore
            require_restitution(
                r, f" at an approach speed of {approach_speed:g} {unit}"
            )
        self.profile.check()
