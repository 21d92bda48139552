"""Draw the convergence of Lyapunov exponents over the first periods."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._axes import figure_of, legend_above, one_axes
from ._style import BAND, styled


@styled
def lyapunov_convergence(spectrum, ax: Axes | None = None) -> Figure:
    """Draw the exponents against the averaging time.

    Bands show the final values with their standard errors.

    Args:
        spectrum: Spectrum of one motion from `variational.lyapunov_spectrum`.
        ax: Axes to draw on; default: a new figure.

    Returns:
        The figure.

    Raises:
        ValueError: The spectrum contains the exponents of several motions.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from jaxcam.plotting import lyapunov_convergence
        >>> from variational import lyapunov_spectrum
        >>> system = ImpactOscillator(omega=3.5, wall=-0.2, damping=0.02)
        >>> start = jnp.array([-0.9, 0.0])
        >>> found = lyapunov_spectrum(system, start, turns=50, transient=20)
        >>> figure = lyapunov_convergence(found)
    """
    running = np.asarray(spectrum.running)
    if running.ndim != 2:
        raise ValueError(
            f"this spectrum is of a batch of {running.shape[0]}; pass a single motion, "
            "such as jax.tree.map(lambda a: a[0], spectrum)"
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
    ax.set_xlabel("averaging time (s)")
    ax.set_ylabel("Lyapunov exponent (1/s)")
    legend_above(ax)
    return figure_of(ax)
