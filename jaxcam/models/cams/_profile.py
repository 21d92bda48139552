"""Cam profiles: the position of the follower in contact with the cam."""

import abc

import equinox as eqx
import jax
from jaxtyping import Array, Real


class CamProfile(eqx.Module):
    """The contact angle of the follower as a function of the cam angle.

    A profile is periodic over one turn and at least three times continuously
    differentiable, because release from the cam depends on the jerk of the gap.

    Examples:
        >>> from jaxcam.models import CamProfile
        >>> class Cosine(CamProfile):
        ...     lift: float = 0.01
        ...     def __call__(self, cam_angle):
        ...         return self.lift * jnp.cos(cam_angle)
        >>> float(Cosine()(0.0))
        0.01
    """

    @abc.abstractmethod
    def __call__(self, cam_angle: Real[Array, "..."]) -> jax.Array:
        """Return the follower angle (rad) in contact at `cam_angle` (rad),
        elementwise.
        """

    def prepared(self) -> "CamProfile":
        """Return an equivalent profile that is cheaper to evaluate many times."""
        return self

    def check(self) -> None:
        """Raise `ValueError` for an invalid profile."""
        return None
