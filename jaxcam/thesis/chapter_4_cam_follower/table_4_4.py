"""Table 4.4: the printed parameters, next to those of a rig.

Raises:
    ValueError: The cam is not an eccentric circle.
"""

from ...models import CamFollower, EccentricCircle
from ..target import Rows, Target


def compute(system: CamFollower) -> Rows:
    cam = system.profile
    if not isinstance(cam, EccentricCircle):
        raise ValueError("Table 4.4 is for a circular cam; give one as `profile`.")
    return [
        ("cam radius R", 0.045, cam.radius, "m"),
        ("cam eccentricity e", 0.015, cam.eccentricity, "m"),
        ("centre of rotation x0", 0.249, cam.center_x, "m"),
        ("centre of rotation y0", 0.0, cam.center_y, "m"),
        ("half height d, contact", 0.021, cam.half_height, "m"),
        ("half height d, spring", 0.021, system.spring_half_height, "m"),
        ("moment of inertia J", 0.043, system.inertia, "kg m^2"),
        ("spring coefficient K", 105.0, system.stiffness, "N/m"),
        ("spring hanging point x_A", -0.031, system.spring_hook_x, "m"),
        ("spring elongation", 0.173, system.spring_elongation, "m"),
        ("M = J/K", 0.043 / 105.0, system.inertia / system.stiffness, "m s^2"),
    ]


TARGET = Target("Parameters of the model", compute)
