"""Figure 4.5: angles of the segments, and discontinuities of the derivatives.

"First discontinuous derivative" is the lowest order whose derivative is discontinuous
at the segment's start. The thesis shows it only in plots.
"""

import numpy as np
from matplotlib.figure import Figure

from ... import plotting
from ...models import CamFollower, MotionProgram, Segment
from ..target import Rows, Target


PROGRAM = (
    ("constant velocity", 0, 60, 60, 1.0),
    ("dwell", 60, 90, 30, 0.0),
    ("constant acceleration", 90, 150, 60, -1.0),
    ("dwell", 150, 180, 30, 0.0),
    ("cubic", 180, 240, 60, 1.0),
    ("dwell", 240, 270, 30, 0.0),
    ("simple harmonic", 270, 330, 60, -1.0),
    ("dwell", 330, 360, 30, 0.0),
)
"""Segments of Figure 4.5 (a): function; start, end and delta angle (degrees); rise."""


def _program() -> MotionProgram:
    """Return the program with unit rises."""
    return MotionProgram(
        [Segment(law, np.deg2rad(width), rise) for law, _, _, width, rise in PROGRAM]
    )


def compute(system: CamFollower) -> Rows:
    del system
    program = _program()
    ends = np.rad2deg(np.cumsum(np.asarray(program.widths)))
    starts = np.append(0.0, ends[:-1])
    angles, jumps = program.joints()
    degrees = np.rad2deg(np.asarray(angles))
    rows = []
    for k, (law, start, end, width, _) in enumerate(PROGRAM):
        name = f"segment {k + 1}, {law}"
        rows.append((f"{name}: start", start, starts[k], "degrees"))
        rows.append((f"{name}: end", end, ends[k], "degrees"))
        rows.append((f"{name}: delta", width, ends[k] - starts[k], "degrees"))
        here = int(np.argmin(np.abs(degrees - start)))
        sizes = np.abs(np.asarray(jumps[here]))
        order = int(np.argmax(sizes > 1e-9)) if np.any(sizes > 1e-9) else np.nan
        rows.append((f"{name}: first discontinuous derivative", np.nan, order, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    del system
    program = _program()
    return plotting.motion_program(program, unit="rise")


TARGET = Target("A motion program with four dwells", compute, draw)
