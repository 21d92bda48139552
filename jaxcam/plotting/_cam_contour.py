"""Draw the shape of a cam."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..models.cams import CamContour
from ._axes import figure_of, legend_above, one_axes
from ._style import CAM, IMPACT, styled


@styled
def cam_contour(contour: CamContour, ax: Axes | None = None) -> Figure:
    """Draw a cam in its own frame, with its axis and its undercut parts.

    Args:
        contour: The contour over a full turn.
        ax: Axes to draw on; default: a new figure.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.models import EccentricCircle, flat_oscillating_contour
        >>> from jaxcam.plotting import cam_contour
        >>> angles = jnp.linspace(0, 2 * jnp.pi, 50)
        >>> drawn = cam_contour(flat_oscillating_contour(EccentricCircle(), angles))
    """
    ax = one_axes(ax)
    x, y = np.asarray(contour.x), np.asarray(contour.y)
    ax.fill(x, y, color=CAM, alpha=0.25, lw=0)
    ax.plot(np.append(x, x[0]), np.append(y, y[0]), color=CAM, label="contour")
    undercut = np.asarray(contour.radius_of_curvature) <= 0
    if np.any(undercut):
        ax.plot(x[undercut], y[undercut], ".", color=IMPACT, label="undercut")
    ax.plot(0, 0, "k+", ms=9, label="axis")
    ax.set_aspect("equal")
    ax.set_xlabel("x (m)")
    ax.set_ylabel("y (m)")
    legend_above(ax)
    return figure_of(ax)
