"""Lyapunov exponents over the first turns, to see them settle."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._axes import figure_of, legend_above, one_axes
from ._style import BAND, styled


@styled
def lyapunov_convergence(spectrum, ax: Axes | None = None) -> Figure:
    """Draw the exponents over the first turns, with their standard errors.

    Args:
        spectrum: Of one motion, from `variational.lyapunov_spectrum`.
        ax: Where to draw; a new figure without.

    Returns:
        The figure.

    Raises:
        ValueError: For the spectra of many motions.
    """
    running = np.asarray(spectrum.running)
    if running.ndim != 2:
        raise ValueError(
            f"this spectrum has {running.shape[0]} lanes; pass one of them, such as "
            "jax.tree.map(lambda a: a[0], spectrum)"
        )
    ax = one_axes(ax)
    time = float(spectrum.turn) * np.arange(1, len(running) + 1)
    ax.axhline(0, color=BAND, linewidth=1.0, zorder=0)
    for k in range(running.shape[1]):
        finite = np.isfinite(running[:, k])
        line = ax.plot(
            time[finite], running[finite, k], color=f"C{k}", label=f"exponent {k + 1}"
        )[0]
        last = float(spectrum.exponents[k])
        error = float(spectrum.stderr[k])
        if np.isfinite(last):
            ax.axhspan(
                last - error, last + error, color=line.get_color(), alpha=0.2, lw=0
            )
    ax.set_xlim(0, time[-1])
    ax.set_xlabel("time averaged over (s)")
    ax.set_ylabel("Lyapunov exponent (1/s)")
    legend_above(ax)
    return figure_of(ax)
