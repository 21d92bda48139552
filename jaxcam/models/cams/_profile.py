"""Cam profiles: the follower's angle while it rests on the cam."""

import abc

import equinox as eqx
import jax
from jaxtyping import Array, Real


class CamProfile(eqx.Module):
    """The follower's contact angle as a function of the cam's angle.

    A profile is periodic over one turn and at least three times continuously
    differentiable, because release from the cam depends on the jerk of the gap.
    """

    @abc.abstractmethod
    def __call__(self, cam_angle: Real[Array, "..."]) -> jax.Array:
        """Follower angle (rad) in contact at `cam_angle` (rad), elementwise."""

    def prepared(self) -> "CamProfile":
        """An equal profile that is cheaper to evaluate many times."""
        return self

    def check(self) -> None:
        """Raise `ValueError` where the profile has no meaning as it stands."""
        return None
