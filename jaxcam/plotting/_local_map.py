"""Draw the local map of the thesis (section 5.4) with cobwebs."""

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from variational.chatter import Lobes, LocalMap

from ._axes import figure_of, legend_above, one_axes
from ._style import FLIGHT, IMPACT, RECORDED, SECTION, styled


@styled
def local_map(
    local: LocalMap,
    lobes: Lobes | None = None,
    ax: Axes | None = None,
    *,
    shift: float = 0.0,
    turns: int = 60,
) -> Figure:
    """Draw the fitted and the simulated map, with a cobweb (thesis, Figures 5.25 and
    5.26).

    Args:
        local: The fitted map from [`variational.fit_local_map`][].
        lobes: The simulated lobes, drawn as dots if `shift` is zero.
        ax: Axes to draw on; default: a new figure.
        shift: Distance by which the map is shifted to the left, to represent the effect
            of a parameter.
        turns: Number of iterations of the cobweb, the first half of which is not drawn.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.plotting import local_map
        >>> from variational.chatter import LocalMap
        >>> numbers = (-1.0, -1.0, 1.0, 1.0, [0.0, 1.0], 0.5, 1.0, 0.0)
        >>> drawn = local_map(LocalMap(*map(jnp.asarray, numbers)))
    """
    ax = one_axes(ax)
    x_0, x_inf = float(local.x_0), float(local.x_inf)
    span = x_0 - x_inf
    # use equal steps in x, and also equal steps in the cube root of the distance from
    # x_0, because the slope is infinite at x_0
    x = np.unique(
        np.concatenate(
            [
                np.linspace(x_inf - 0.4 * span, x_0, 2000),
                x_0 - span * np.linspace(0, 1, 4000) ** 3,
            ]
        )
    )
    if lobes is not None and shift == 0:
        ax.plot(
            lobes.scan,
            lobes.scanned,
            ".",
            color=IMPACT,
            ms=3,
            label="measured",
            zorder=3,
        )
    # the fit is valid for the first lobe and those inside it
    shown = np.asarray(local(jnp.asarray(x)))
    ax.plot(x - shift, shown, color=FLIGHT, lw=1.2, label="fitted")
    ends = np.array([x[0] - shift, x[-1] - shift])
    ax.plot(ends, ends, color=RECORDED, ls="--", lw=1, label="identity")
    points, value = [], float(local.alpha_inf)
    for k in range(turns):
        after = float(local(value + shift))
        if k >= turns // 2:
            points += [(value, after), (after, after)]
        value = after
    web = np.array(points).T
    ax.plot(*web, color=SECTION, lw=0.7, label="cobweb")
    ax.set_xlabel("state at the section")
    ax.set_ylabel("state one period later")
    ax.set_ylim(np.nanmin(shown) - 0.1 * span, np.nanmax(shown) + 0.3 * span)
    legend_above(ax)
    return figure_of(ax)
