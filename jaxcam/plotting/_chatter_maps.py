"""Draw the maps of chatter theory: the lambda-map, and the lobes with their scaling."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from variational import beta_map, lambda_inverse, lambda_map, scaling_law

from ._axes import figure_of, legend_above, one_axes
from ._style import FLIGHT, IMPACT, RECORDED, SECTION, styled


@styled
def lambda_cobweb(r: float, ax: Axes | None = None, *, start=None) -> Figure:
    """Draw f(lambda) with its fixed point (thesis, Figure 6.5).

    Args:
        r: Coefficient of restitution.
        ax: Axes to draw on; default: a new figure.
        start: Initial values of lambda for the cobwebs; by default, one value on each
            side of the fixed point, one with complete and one with interrupted chatter.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.plotting import lambda_cobweb
        >>> drawn = lambda_cobweb(0.5)
    """
    ax = one_axes(ax)
    law = scaling_law(r)
    bar = float(law.lambda_bar)
    top = 0.45
    for low, high in ((0.0, 1 / 3 - 1e-4), (1 / 3 + 1e-4, 3 / 8)):
        lam = np.linspace(low, high, 800)
        value = np.asarray(lambda_map(lam, r))
        label = r"$f(\lambda)$" if low == 0 else None
        ax.plot(
            lam, np.where(value < 2 * top, value, np.nan), color=FLIGHT, label=label
        )
    ax.plot([0, top], [0, top], color=RECORDED, ls="--", lw=1, label="identity")
    starts = (0.93 * bar, 1.05 * bar) if start is None else start
    for first, colour in zip(starts, (SECTION, IMPACT), strict=False):
        ax.plot(*_cobweb(first, r), color=colour, lw=0.8)
    ax.plot(bar, bar, "o", color=SECTION, ms=5, label=rf"$\bar\lambda$ = {bar:.4f}")
    ax.axvline(3 / 8, color=RECORDED, ls=":", lw=1, label=r"$\lambda_{max}$ = 3/8")
    ax.set(
        xlim=(0, 0.4),
        ylim=(0, top),
        xlabel=r"$\lambda_k$ (–)",
        ylabel=r"$\lambda_{k+1}$ (–)",
    )
    legend_above(ax)
    return figure_of(ax)


def _cobweb(lam, r, most=40):
    points = [(lam, 0.0)]
    for _ in range(most):
        after = float(lambda_map(lam, r))
        if not np.isfinite(after):
            break
        points += [(lam, after), (after, after)]
        lam = after
    return np.array(points).T


@styled
def beta_lobes(
    r: float, ax: Axes | None = None, *, measured=None, lobes: int = 4
) -> Figure:
    """Plot beta against lambda - lambda_bar, with its corners (thesis, Figures 6.14 and
    6.15).

    Args:
        r: Coefficient of restitution.
        ax: Axes to draw on; default: a new figure.
        measured: Simulated values of lambda - lambda_bar and of beta, drawn behind the
            theoretical curve.
        lobes: Number of lobes, starting with the largest.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.plotting import beta_lobes
        >>> drawn = beta_lobes(0.5)
    """
    ax = one_axes(ax)
    bar = float(scaling_law(r).lambda_bar)
    corners = [3 / 8]
    for _ in range(lobes):
        corners.append(float(lambda_inverse(corners[-1], r)))
    share = np.linspace(0, 1, 300) ** 2
    pieces = [a + share * (b - a) for a, b in zip(corners, corners[1:], strict=False)]
    lam = np.concatenate(pieces)
    if measured is not None:
        ax.plot(*measured, color=IMPACT, lw=3.2, alpha=0.55, label="simulated")
    ax.plot(
        lam - bar, beta_map(lam, r), color=FLIGHT, lw=1.2, label=r"$\beta(\lambda)$"
    )
    at = np.array(corners)
    ax.plot(
        at - bar, beta_map(at, r), "o", color=SECTION, ms=3, label="an impact is lost"
    )
    ax.axhline(0, color=RECORDED, lw=0.8)
    ax.set(xlabel=r"$\lambda - \bar\lambda$ (–)", ylabel=r"$\beta$ (–)")
    legend_above(ax)
    return figure_of(ax)


@styled
def lobe_scaling(distance, height, kappa: float, ax: Axes | None = None) -> Figure:
    """Plot the heights of lobes against their distance from the interruption (thesis,
    eq. 6.53).

    Args:
        distance: Distances, positive, shape `(k,)`.
        height: Heights, positive, shape `(k,)`.
        kappa: Theoretical exponent.
        ax: Axes to draw on; default: a new figure.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.plotting import lobe_scaling
        >>> drawn = lobe_scaling(np.array([0.1, 0.01]), np.array([0.02, 0.001]), 1.3)
    """
    ax = one_axes(ax)
    distance, height = np.asarray(distance), np.asarray(height)
    slope, level = np.polyfit(np.log(distance), np.log(height), 1)
    ax.loglog(distance, height, "o", color=IMPACT, ms=5, label="lobes")
    ax.loglog(
        distance,
        np.exp(level) * distance**slope,
        color=FLIGHT,
        label=f"fit, exponent {slope:.4f}",
    )
    law = height[-1] * (distance / distance[-1]) ** kappa
    ax.loglog(
        distance, law, color=SECTION, ls="--", lw=1, label=rf"$\kappa$ = {kappa:.4f}"
    )
    # over less than two decades, the labels of minor ticks overlap
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set(xlabel="distance from the interruption (–)", ylabel="height of the lobe (–)")
    legend_above(ax)
    return figure_of(ax)
