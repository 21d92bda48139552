"""The cam-follower of the package, as a system in a file."""

from jaxcam.models import CamFollower, ConstantRestitution


class Cam(CamFollower):
    """A cam-follower of constant restitution."""

    restitution: ConstantRestitution = ConstantRestitution(0.55)  # pyright: ignore
