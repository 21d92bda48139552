"""Draw the motion program of a cam: s, v, a and j over a turn."""

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from ..models import MotionProgram
from ._axes import several_axes
from ._style import CAM, FLIGHT, styled


_NAMES = ("lift", "velocity", "acceleration", "jerk")
_POINTS = 200


@styled
def motion_program(program: MotionProgram, axes=None, *, unit: str = "rad") -> Figure:
    """Draw the lift and its first three derivatives with respect to the cam angle.

    Where a derivative jumps, its curve is broken, and the values on the two sides are
    connected by a dashed line. The infinite pulse of the next higher derivative is not
    drawn.

    Args:
        program: The motion program.
        axes: Four axes; default: a new figure.
        unit: Unit of the lift, "rad" or "m".

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.models import MotionProgram, Segment
        >>> from jaxcam.plotting import motion_program
        >>> rises = (0.01, -0.01)
        >>> program = MotionProgram([Segment("cycloidal", np.pi, r) for r in rises])
        >>> drawn = motion_program(program, unit="m")
    """
    figure, axes = several_axes(axes, (4, 1), sharex=True, figsize=(6.4, 8.4))
    axes = axes[:, 0]
    pieces = program.prepared()
    starts, ends = np.asarray(pieces.starts), np.asarray(pieces.ends())
    grid = np.linspace(starts, ends, _POINTS, axis=1)
    jets = np.asarray(pieces.jet(np.arange(len(starts))[:, None], jnp.asarray(grid)))
    broken = np.full((len(starts), 1), np.nan)
    degrees = np.rad2deg(np.concatenate([grid, broken], axis=1))
    joints = np.asarray(program.joints().angle)
    for k, ax in enumerate(axes):
        values = np.concatenate([jets[..., k], broken], axis=1)
        ends_here = np.stack([np.roll(jets[:, -1, k], 1), jets[:, 0, k]], axis=1)
        jumps = np.concatenate([ends_here, broken], axis=1)
        at = np.rad2deg(np.stack([joints] * 3, axis=1))
        ax.plot(at.ravel(), jumps.ravel(), color=CAM, lw=0.9, linestyle=(0, (3, 2)))
        ax.plot(degrees.ravel(), values.ravel(), color=FLIGHT, lw=1.3)
        ax.axhline(0.0, color="0.75", lw=0.6, zorder=0)
        order = ("", "/rad", "/rad$^2$", "/rad$^3$")[k]
        ax.set_ylabel(f"{_NAMES[k]}\n({unit}{order})")
    axes[-1].set_xlabel("cam angle (degrees)")
    axes[-1].set_xlim(0, 360)
    axes[-1].set_xticks(np.arange(0, 361, 30))
    return figure
