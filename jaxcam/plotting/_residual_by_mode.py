"""Draw the residuals of a model in flight, in contact and at impacts."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.stats import norm

from ..recordings.against_model import Comparison, Residuals
from ..recordings.files import without_unit
from ..tables import scaled
from ._axes import several_axes
from ._style import BAND, FLIGHT, styled
from .labels import labelled


# odd, so that one of the bins is centred at zero
_BINS = 37
_ANGLE_TICKS = ("0", r"$\pi/2$", r"$\pi$", r"$3\pi/2$", r"$2\pi$")


@styled
def residual_by_mode(
    comparison: Comparison,
    axes: Sequence[Axes] | np.ndarray | None = None,
    *,
    record: str | None = None,
    against: Literal["time", "phase"] = "time",
) -> Figure:
    """Draw recording minus model, one row for each mode and channel.

    The left panel shows the residuals with a grey +-2 sigma band of the noise; the
    right panel shows their histogram (bars) and that of the noise alone (black line).
    Error bars at impacts show the standard errors.

    Args:
        comparison: The comparison from `jaxcam.recordings.compare` or `compare_case`.
        axes: Two axes for each mode and channel, row by row; default: a new figure.
        record: Name of a single recording to draw; default: all, each in its own
            colour.
        against: "time" (s), or "phase" for the cam angle within one turn (rad).

    Returns:
        The figure.

    Raises:
        ValueError: There is nothing to draw, the system has no cam and so no phase,
            or `against` is unknown.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.plotting import residual_by_mode
        >>> from jaxcam.recordings import Recording, compare, segment
        >>> ball, time = BouncingBall(), np.linspace(0.0, 1.0, 1001)
        >>> motion = jaxcam.simulate(ball, [1.0, 0.0], 0.0, 1.0)
        >>> height = np.random.default_rng(0).normal(motion.at(time)[:, 0], 1e-4)
        >>> run = Recording("run", time, {"height_m": height})
        >>> parts = segment(run, "height_m", 0.0)
        >>> figure = residual_by_mode(compare(ball, parts))
    """
    if against not in ("time", "phase"):
        raise ValueError(f'against is {against!r}; choose "time" or "phase".')
    groups = _groups(comparison, record)
    figure, grid = several_axes(
        axes,
        (len(groups), 2),
        sharex="col",
        sharey="row",
        width_ratios=(3.2, 1.0),
        figsize=(6.8, 1.0 + 1.6 * len(groups)),
    )
    names = sorted({part.record for parts in groups for part in parts})
    colours = {
        name: f"C{k % 7}" if len(names) > 1 else FLIGHT for k, name in enumerate(names)
    }
    highest = 0.0
    for (left, right), parts in zip(grid, groups, strict=True):
        share = _draw_row(left, right, parts, colours, against)
        highest = max(highest, share)
    if len(names) > 1:
        _name_records(figure, colours)
    left, right = grid[-1]
    left.set_xlabel(
        "time (s)" if against == "time" else "cam angle within one turn (rad)"
    )
    right.set_xlabel("fraction (%)")
    grid[0, 1].set_title("line: noise alone", fontsize="small")
    # The limit is common to all rows. If a residual is large, the noise alone fills a
    # single bin, and the line may be truncated there.
    right.set_xlim(0.0, 1.25 * highest)
    if against == "phase":
        left.set_xticks(np.arange(5) * np.pi / 2, _ANGLE_TICKS)
    figure.align_ylabels(list(grid[:, 0]))
    return figure


def _groups(comparison: Comparison, record: str | None) -> list[list[Residuals]]:
    """Return the residuals of each mode and channel, in the order of the comparison."""
    groups: dict[tuple[str, str], list[Residuals]] = {}
    for part in comparison.residuals:
        if record in (None, part.record) and len(part.value):
            groups.setdefault((part.mode, part.channel), []).append(part)
    if not groups:
        there = sorted({part.record for part in comparison.residuals})
        raise ValueError(
            f"There are no residuals to draw{f' of {record}' if record else ''}; the "
            f"comparison has {', '.join(there) or 'no recording'}."
        )
    return list(groups.values())


def _draw_row(left: Axes, right: Axes, parts, colours, against) -> float:
    """Draw both panels; return the length of the longest bar."""
    value = np.concatenate([part.value for part in parts])
    stderr = np.concatenate([part.stderr for part in parts])
    rms, noise = float(np.sqrt(np.mean(value**2))), float(np.sqrt(np.mean(stderr**2)))
    largest = float(max(np.max(np.abs(value)), 4 * noise))
    factor, unit = scaled(parts[0].unit, largest)
    band = 2 * factor * noise
    for ax in (left, right):
        ax.axhspan(-band, band, color=BAND, alpha=0.5, linewidth=0, zorder=0.5)
        ax.axhline(0.0, color="black", linewidth=0.8)
    for part in parts:
        _draw_part(left, part, factor, colours[part.record], against)
    limit = 1.08 * factor * largest
    highest = _draw_shares(right, factor * value, factor * stderr, limit)
    left.set_ylim(-limit, limit)
    left.set_ylabel(labelled("residual", unit))
    left.set_title(
        f"{_title(parts[0])}: {f'{factor * rms:.3g} {unit}'.rstrip()} rms, "
        f"noise {factor * noise:.2g}",
        fontsize="medium",
    )
    right.tick_params(labelleft=False)
    return highest


def _draw_part(ax: Axes, part: Residuals, factor, colour, against) -> None:
    if against == "time":
        place = part.time
    elif np.all(np.isnan(part.turned)):
        raise ValueError(
            f"{part.record} was compared without a cam, so there is no phase; choose "
            'against="time".'
        )
    else:
        place = np.mod(part.turned, 2 * np.pi)
    if part.mode.startswith("impact"):
        ax.errorbar(
            place,
            factor * part.value,
            factor * part.stderr,
            fmt="o",
            color=colour,
            markersize=3,
            elinewidth=0.8,
            label=part.record,
        )
        return
    # thousands of dots would make a vector file large and slow
    ax.plot(
        place,
        factor * part.value,
        ".",
        color=colour,
        markersize=2,
        alpha=0.5,
        markeredgewidth=0,
        rasterized=True,
        label=part.record,
    )


def _draw_shares(
    ax: Axes, value: Float[np.ndarray, " k"], stderr: Float[np.ndarray, " k"], limit
) -> float:
    edges = np.linspace(-limit, limit, _BINS + 1)
    share = 100 * np.histogram(value, edges)[0] / len(value)
    ax.barh(edges[:-1], share, np.diff(edges), align="edge", color=FLIGHT, alpha=0.75)
    sizes, counts = np.unique(stderr, return_counts=True)
    below = norm.cdf(edges[:, None] / sizes) @ counts / len(stderr)
    ax.stairs(
        100 * np.diff(below),
        edges,
        orientation="horizontal",
        color="black",
        linewidth=1.0,
        baseline=None,
    )
    return float(share.max())


def _name_records(figure: Figure, colours: dict[str, str]) -> None:
    # titles are above each panel, so the names of the recordings are above all panels
    dots = [
        Line2D([], [], marker="o", linestyle="", color=colour, label=name)
        for name, colour in colours.items()
    ]
    place = "outside upper left" if figure.get_constrained_layout() else "upper left"
    figure.legend(handles=dots, loc=place, ncols=3, handletextpad=0.2)


def _title(part: Residuals) -> str:
    # contacts and impacts refer to the segmented channel; only flights may have several
    channel = without_unit(part.channel)
    return f"{part.mode}, {channel}" if part.mode == "flight" else part.mode
