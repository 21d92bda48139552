"""A cam motion program of the kind found in handbooks: a modified-sine rise, a dwell,
and a constant-acceleration return, in which the acceleration jumps."""

import numpy as np

from jaxcam.models import MotionProgram, Segment
from jaxcam.plotting import motion_program


program = MotionProgram(
    [
        Segment("modified sine", np.deg2rad(120), 0.012),
        Segment("dwell", np.deg2rad(60)),
        Segment("constant acceleration", np.deg2rad(120), -0.012),
        Segment("dwell", np.deg2rad(60)),
    ]
)
figure = motion_program(program, unit="m")
figure.set_size_inches(6.4, 6.4)
