"""The figures of a report of `jaxcam diagnose`."""

import dataclasses
import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np

from ..discrepancy import Diagnosis
from ..discrepancy.report import MissingFunction
from ..discrepancy.terms import Relaxation, unit_along
from ..fitting import Residuals
from ._changed import changed
from ._ranking_figure import RANKING, ranking
from ._residual_axes import Along, residual_label, shown_in, sides, title_of
from ._restitution_figure import has_law, RESTITUTION, restitution
from ._shapes_figure import caption, has_shapes, shapes


matplotlib.use("Agg")

from ..plotting import save_figure, style
from ..plotting.colours import CONTACT, FLIGHT, IMPACT
from ..plotting.labels import labelled


_BINS = 36
# maximum ratio of two residuals that are drawn on axes of the same range
_RANGES = 8.0


def draw(folder: Path, found: Diagnosis) -> list[tuple[Path, str]]:
    """Write all figures, and return each with its caption."""
    import matplotlib.pyplot as plt

    unseen, maps = (_UNSEEN, _MAPS) if changed(found) else (_UNSEEN_ALONE, _MAPS_ALONE)
    of = (
        _MEDIAN
        if len({part.record for part in found.unseen[0]}) > 1
        else "the recording"
    )
    ranges = "" if _one_range(_typical(found)) else _TWO_RANGES
    unseen = unseen.format(of, ranges)
    colours = _COLOURS.format(_most_of_noise(found))
    maps = maps.format(Along(found.unseen[0]).word, colours)
    with style():
        missing = folder / "missing.png"
        functions = []
        if found.missing:
            functions.append((save_figure(_missing(plt, found), missing), _MISSING))
        if has_law(found):
            law = save_figure(restitution(plt, found), folder / "restitution.png")
            functions.append((law, RESTITUTION))
        left = []
        if has_shapes(found):
            drawn = save_figure(shapes(plt, found), folder / "shapes.png")
            left.append((drawn, caption(found)))
        return [
            *functions,
            (save_figure(_unseen(plt, found), folder / "unseen.png"), unseen),
            (save_figure(_maps(plt, found), folder / "maps.png"), maps),
            *left,
            (save_figure(ranking(plt, found), folder / "ranking.png"), RANKING),
        ]


_MISSING = (
    "Functions fitted to the unknown effects together with the rig parameters, with "
    "bands of twice the standard error. A function of two arguments is shown against "
    "the first one, at several values of the second. The rig parameters may have "
    "absorbed any part that they can represent."
)
_UNSEEN = (
    "Residuals of held-out sections of {}, predicted one flight ahead after a fit to "
    "the other sections: the textbook model (top), and the model with the missing "
    "effects (bottom). The band is +-2 standard deviations of the noise.{}"
)
_MEDIAN = "the recording with the median improvement by the missing effects"
_TWO_RANGES = " The two axes have different ranges."
_UNSEEN_ALONE = (
    "Residuals of held-out sections of one recording, predicted one flight ahead by "
    "the textbook model after a fit to the other sections. The band is +-2 standard "
    "deviations of the noise."
)
_MAPS = (
    "Mean residual of each recording against {}, in standard errors, before (left) "
    "and after (right) the missing effects are added: flights at the top, contacts (if "
    "any) at the bottom. {}"
)
_MAPS_ALONE = (
    "Mean residual of each recording against {}, in standard errors: flights at the "
    "top, contacts (if any) at the bottom. {}"
)
_COLOURS = (
    "For pure noise, one such map in a hundred would exceed +-{:.2g} standard errors; "
    "the colour scale is linear up to this limit and logarithmic above it."
)


def _unseen(plt, found: Diagnosis):
    before, _ = found.unseen
    labels = ("textbook model, refitted", "with the missing effects")
    rows = 2 if changed(found) else 1
    both = _typical(found)
    figure, axes = plt.subplots(
        rows,
        1,
        figsize=(6.8, 0.6 + 1.8 * rows),
        sharex=True,
        sharey=_one_range(both),
        layout="constrained",
        squeeze=False,
    )
    axes = axes[:, 0]
    factor, _ = shown_in(both[0])
    for axis, part, label in zip(axes, both, labels):
        for resting in sides(both):
            keep = part.resting == resting
            axis.plot(
                part.time[keep],
                factor * part.value[keep],
                ".",
                ms=1.5,
                color=CONTACT if resting else FLIGHT,
                label="contact" if resting else "flight",
                rasterized=True,
            )
        band = 2 * factor * part.noise
        axis.axhspan(-band, band, color="0.5", alpha=0.25, lw=0, label="noise ± 2σ")
        axis.set_title(f"{title_of(part, before)}: {label}")
        axis.set_ylabel(residual_label(part))
    axes[-1].set_xlabel("time (s)")
    figure.align_ylabels(axes)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, markerscale=6, ncols=3, loc="outside upper right")
    return figure


def _typical(found: Diagnosis) -> tuple[Residuals, Residuals]:
    """Return the residuals before and after of the recording (and channel) with the
    median improvement; its sections, held out in turn, are joined.
    """
    keys = list(dict.fromkeys((p.record, p.channel) for p in found.unseen[0]))
    before, after = (
        [_joined([p for p in parts if (p.record, p.channel) == key]) for key in keys]
        for parts in found.unseen
    )
    pairs = sorted(zip(before, after), key=_improvement)
    return pairs[(len(pairs) - 1) // 2]


def _joined(parts: Sequence[Residuals]) -> Residuals:
    """Return the residuals of several sections of a recording as one object."""
    columns = ("time", "turned", "value", "flight", "resting")
    whole = {n: np.concatenate([getattr(p, n) for p in parts]) for n in columns}
    return dataclasses.replace(parts[0], **whole)


def _one_range(pair: tuple[Residuals, Residuals]) -> bool:
    """Return whether both residuals can be seen on axes of the same range."""
    sizes = [float(np.max(np.abs(part.value))) for part in pair]
    return max(sizes) < _RANGES * max(min(sizes), pair[0].noise)


def _improvement(pair: tuple[Residuals, Residuals]) -> float:
    """Return the ratio of the mean squared residuals before and after the diagnosis."""
    before, after = (float(np.mean(part.value**2)) for part in pair)
    return before / max(after, 1e-300)


def _maps(plt, found: Diagnosis):
    from matplotlib.colors import SymLogNorm

    every = found.unseen[0]
    along, shown = Along(every), sides(every)
    sets = (", before", ", after") if changed(found) else ("",)
    figure, axes = plt.subplots(
        len(shown),
        len(sets),
        figsize=(6.8, 0.6 + 1.9 * len(shown)),
        sharex=True,
        sharey=True,
        layout="constrained",
        squeeze=False,
    )
    names = list(dict.fromkeys(title_of(part, every) for part in every))
    maps = [
        [_rows(parts, names, resting, along) for resting in shown]
        for parts in found.unseen[: len(sets)]
    ]
    most = _most_of_noise(found)
    sizes = np.abs(maps)
    end = float(np.max(sizes, where=np.isfinite(sizes), initial=most))
    scale = SymLogNorm(linthresh=most, vmin=-end, vmax=end)
    image = None
    for column, of_model, which in zip(axes.T, maps, sets):
        for axis, rows, resting in zip(column, of_model, shown):
            image = axis.imshow(
                rows,
                aspect="auto",
                extent=(along.start, along.end, len(rows) - 0.5, -0.5),
                norm=scale,
                cmap="RdBu_r",
                interpolation="nearest",
            )
            axis.set_yticks(range(len(rows)), names)
            axis.set_title(f"{'contact' if resting else 'flight'}{which}")
            axis.grid(False)
    for axis in axes[-1]:
        axis.set_xlabel(along.label)
    _colour_bar(figure, image, axes, most)
    return figure


def _colour_bar(figure, image, axes, most: float) -> None:
    """Draw a colour bar with ticks at the limits `most` of its linear part."""
    bar = figure.colorbar(image, ax=axes, label="mean residual\n(standard errors)")
    powers = 10.0 ** np.arange(1, 1 + math.log10(image.norm.vmax))
    inside = (1.5 * most < powers) & (powers <= image.norm.vmax)
    ticks = [most, *powers[inside]]
    names = [f"{most:.2g}", *(f"{power:g}" for power in powers[inside])]
    bar.set_ticks(
        [*(-tick for tick in reversed(ticks)), 0.0, *ticks],
        labels=[*(f"\N{MINUS SIGN}{name}" for name in reversed(names)), "0", *names],
    )
    bar.minorticks_off()


def _most_of_noise(found: Diagnosis) -> float:
    """Return the mean residual, in standard errors, that maps of pure noise exceed once
    in a hundred times.
    """
    from scipy.stats import norm

    every = found.unseen[0]
    names = {title_of(part, every) for part in every}
    return float(norm.isf(0.005 / (_BINS * len(names) * len(sides(every)))))


def _rows(parts: Sequence[Residuals], names, resting: bool, along: Along):
    """Return the mean residual in each bin, with one row for each of the names."""
    return np.array(
        [
            _binned([p for p in parts if title_of(p, parts) == name], resting, along)
            for name in names
        ]
    )


def _binned(parts: Sequence[Residuals], resting: bool, along: Along):
    """Return the mean residual of a recording in each bin, in standard errors.

    **Arguments:** the parts of the recording, each held out once.
    """
    count, total = np.zeros(_BINS), np.zeros(_BINS)
    for part in parts:
        keep = part.resting == resting
        place = (along.place(part)[keep] - along.start) / (along.end - along.start)
        where = np.minimum((place * _BINS).astype(int), _BINS - 1)
        count += np.bincount(where, minlength=_BINS)
        total += np.bincount(where, part.value[keep] / part.noise, minlength=_BINS)
    return np.where(count > 0, total / np.sqrt(np.maximum(count, 1)), np.nan)


def _missing(plt, found: Diagnosis):
    count = len(found.missing)
    figure, axes = plt.subplots(
        1, count, figsize=(4.5 * count, 3.2), layout="constrained", squeeze=False
    )
    for axis, one in zip(axes.flat, found.missing):
        name, along = one.arguments[0], one.grid[0]
        value, error = (np.atleast_2d(x.T) for x in (one.value, one.stderr))
        rows = [0] if len(value) == 1 else np.linspace(0, len(value) - 1, 5).astype(int)
        for row in rows:
            color = IMPACT if len(rows) == 1 else plt.cm.viridis(row / len(value))
            label = None
            if len(rows) > 1:
                second = one.arguments[1]
                unit = _unit_of(one, second, found.unit)
                label = f"{second} {one.grid[1][row]:.2g} {unit}".rstrip()
            low, high = value[row] - 2 * error[row], value[row] + 2 * error[row]
            axis.fill_between(along, low, high, color=color, alpha=0.25, lw=0)
            axis.plot(along, value[row], color=color, label=label)
        neutral = 1.0 if one.kind == "restitution" else 0.0
        axis.axhline(neutral, color="k", lw=0.6)
        axis.set_xlabel(labelled(name, _unit_of(one, name, found.unit)))
        kind = "factor on the restitution" if one.kind == "restitution" else one.kind
        axis.set_ylabel(labelled(kind, one.unit.replace("^2", "²")))
        if one.kind == "resonance":
            axis.set_xscale("log")
        if len(rows) > 1:
            # beside the axes, where it hides no curve
            axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _unit_of(one: MissingFunction, argument: str, motion: str) -> str:
    """Return the unit of an argument of a missing function, given the unit of the
    motion.
    """
    if argument == "frequency":
        return "Hz"
    if argument == "memory":
        return "s" if isinstance(one.element, Relaxation) else motion
    return unit_along(argument, motion)
