"""The figures of a report of `jaxcam diagnose`."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np

from ..discrepancy import Diagnosis
from ..discrepancy.evidence import Structure
from ..discrepancy.report import MissingFunction, spelled
from ..discrepancy.terms import Relaxation, Variable
from ..fitting import Residuals
from ._residual_axes import Along, residual_label, shown_in, title_of


matplotlib.use("Agg")

from ..plotting import save_figure, style
from ..plotting.colours import CONTACT, FLIGHT, IMPACT, RECORDED
from ..plotting.labels import labelled


_BINS = 36
# maximum length of a line of a label (characters)
_LABEL = 42


def unit_along(variable: str, motion: str) -> str:
    """Return the unit of the argument of a shape, given the unit of the motion."""
    of_drive = {Variable.PHASE: "rad", Variable.TIME: "s"}
    if variable in of_drive:
        return of_drive[Variable(variable)]
    if motion in ("", "-"):
        return "-" if variable == Variable.POSITION else "1/s"
    return motion if variable == Variable.POSITION else f"{motion}/s"


def draw(folder: Path, found: Diagnosis) -> list[tuple[Path, str]]:
    """Write all figures, and return each with its caption."""
    import matplotlib.pyplot as plt

    maps = _MAPS.format(Along(found.unseen[0]).word)
    shapes = _SHAPES if found.left_after else _SHAPES_BEFORE
    with style():
        missing = folder / "missing.png"
        nameless = []
        if found.missing:
            nameless = [(save_figure(_missing(plt, found), missing), _MISSING)]
        return [
            *nameless,
            (save_figure(_unseen(plt, found), folder / "unseen.png"), _UNSEEN),
            (save_figure(_maps(plt, found), folder / "maps.png"), maps),
            (save_figure(_shapes(plt, found), folder / "shapes.png"), shapes),
            (save_figure(_ranking(plt, found), folder / "ranking.png"), _RANKING),
        ]


_MISSING = (
    "Functions fitted to the unknown effects together with the rig parameters, with "
    "bands of twice the standard error. A function of two arguments is shown against "
    "the first one, at several values of the second. The rig parameters may have "
    "absorbed any part that they can represent."
)
_UNSEEN = (
    "Residuals of a held-out recording, predicted one flight ahead: the textbook "
    "model refitted to the other recordings (top), and the model with the missing "
    "effects (bottom). The band is +-2 standard deviations of the noise."
)
_MAPS = (
    "Mean residual of each recording against {}, in standard errors, before (left) "
    "and after (right) the missing effects are added: flights at the top, contacts (if "
    "any) at the bottom. For pure noise, one such map in a hundred would exceed the "
    "colour range."
)
_SHAPES = (
    "Estimated corrections of the textbook model (grey) and of the model with the "
    "missing effects (colour), as free functions with bands of twice the standard "
    "error. A correction whose band contains zero is not needed."
)
_SHAPES_BEFORE = (
    "Corrections of the textbook model, each estimated alone as a free function, with "
    "bands of twice the standard error. One missing effect shows in several of them; "
    "the verdict contains what explains the data best."
)
_RANKING = "BIC of other explanations minus that of the verdict (logarithmic scale)."


def _unseen(plt, found: Diagnosis):
    before, after = found.unseen
    figure, axes = plt.subplots(
        2, 1, figsize=(8.5, 4.6), sharex=True, sharey=True, layout="constrained"
    )
    both = max(zip(before, after), key=_improvement)
    factor, _ = shown_in(both[0])
    for axis, part, label in zip(
        axes, both, ("textbook model, refitted", "with the missing effects")
    ):
        for resting in _sides(both):
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
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, markerscale=6, ncols=3, loc="outside upper right")
    return figure


def _improvement(pair: tuple[Residuals, Residuals]) -> float:
    """Return the ratio of the mean squared residuals before and after the diagnosis."""
    before, after = (float(np.mean(part.value**2)) for part in pair)
    return before / max(after, 1e-300)


def _maps(plt, found: Diagnosis):
    from scipy.stats import norm

    every = found.unseen[0]
    along, sides = Along(every), _sides(every)
    figure, axes = plt.subplots(
        len(sides),
        2,
        figsize=(8.5, 0.6 + 2.2 * len(sides)),
        sharex=True,
        sharey=True,
        layout="constrained",
        squeeze=False,
    )
    names = list(dict.fromkeys(title_of(part, every) for part in every))
    end = float(norm.isf(0.005 / (_BINS * len(names) * len(sides))))
    image = None
    for column, parts, which in zip(axes.T, found.unseen, ("before", "after")):
        for axis, resting in zip(column, sides):
            rows = [
                _binned(
                    [p for p in parts if title_of(p, every) == name], resting, along
                )
                for name in names
            ]
            image = axis.imshow(
                np.array(rows),
                aspect="auto",
                extent=(along.start, along.end, len(rows) - 0.5, -0.5),
                vmin=-end,
                vmax=end,
                cmap="RdBu_r",
                interpolation="nearest",
            )
            axis.set_yticks(range(len(rows)), names)
            axis.set_title(f"{'contact' if resting else 'flight'}, {which}")
            axis.grid(False)
    for axis in axes[-1]:
        axis.set_xlabel(along.label)
    figure.colorbar(
        image, ax=axes, label="mean residual\n(standard errors)", extend="both"
    )
    return figure


def _sides(parts: Sequence[Residuals]) -> tuple[bool, ...]:
    """Return the values of `resting` for which residuals are drawn: `False` (flight),
    and `True` (contact) if there is any contact.
    """
    return (False, True) if any(np.any(part.resting) for part in parts) else (False,)


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
                label = f"{one.arguments[1]} {one.grid[1][row]:.2g}"
            low, high = value[row] - 2 * error[row], value[row] + 2 * error[row]
            axis.fill_between(along, low, high, color=color, alpha=0.25, lw=0)
            axis.plot(along, value[row], color=color, label=label)
        neutral = 1.0 if one.kind == "restitution" else 0.0
        axis.axhline(neutral, color="k", lw=0.6)
        axis.set_xlabel(labelled(name, _unit_of(one, name, found.unit)))
        axis.set_ylabel(labelled(one.kind, one.unit.replace("^2", "²")))
        if one.kind == "resonance":
            axis.set_xscale("log")
        if len(rows) > 1:
            axis.legend(fontsize=8)
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


def _shapes(plt, found: Diagnosis):
    before = {one.name: one for one in found.left_before if len(one.grid)}
    after = {one.name: one for one in found.left_after if len(one.grid)}
    rows = -(-len(before) // 3)
    figure, axes = plt.subplots(rows, 3, figsize=(9, 2.3 * rows), layout="constrained")
    for axis in axes.flat[len(before) :]:
        axis.axis("off")
    for axis, name in zip(axes.flat, before):
        _band(axis, before[name], RECORDED, "textbook model")
        if name in after:
            _band(axis, after[name], IMPACT, "with the missing effects")
        axis.axhline(0.0, color="k", lw=0.6)
        one = before[name]
        axis.set_xlabel(labelled(one.variable, unit_along(one.variable, found.unit)))
        axis.set_ylabel(labelled(one.quantity, one.unit.replace("^2", "²")))
        axis.xaxis.label.set_size(10)
        axis.yaxis.label.set_size(10)
        axis.tick_params(labelsize=10)
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=2, loc="outside upper right")
    return figure


def _band(axis, one: Structure, color, label) -> None:
    axis.fill_between(
        one.grid,
        one.value - 2 * one.stderr,
        one.value + 2 * one.stderr,
        color=color,
        alpha=0.3,
        lw=0,
    )
    axis.plot(one.grid, one.value, color=color, label=label)


def _broken(name: str) -> str:
    """Return a long name, such as a formula, in at most two lines."""
    lines = textwrap.wrap(name, _LABEL, break_on_hyphens=False)
    if len(lines) > 2:
        lines = [lines[0], f"{lines[1]} …"]
    return "\n".join(lines)


def _ranking(plt, found: Diagnosis):
    ranked = found.alternatives[: found.policy.alternatives]
    pairs = [(one.name, one.delta_bic) for one in ranked] or [("none", 0.0)]
    names = [_broken(spelled(name)) for name, _ in pairs]
    rows = len(pairs) + sum(name.count("\n") for name in names) / 2
    figure, axis = plt.subplots(figsize=(8, 0.35 * rows + 1.0), layout="constrained")
    # dots, not bars: a logarithmic axis has no zero for bars to start from
    for row, (_, delta) in enumerate(pairs):
        axis.plot(max(delta, 0.1), row, "o", color=FLIGHT)
        axis.annotate(
            f"{delta:.3g}", (max(delta, 0.1), row), (7, 0), va="center",
            textcoords="offset points", fontsize="small",
        )  # fmt: skip
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(-0.6, len(names) - 0.4)
    axis.set_xscale("log")
    # the axis starts at the same value in every report, so that reports can be compared
    axis.set_xlim(0.05, max(1e2, 4 * max(delta for _, delta in pairs)))
    axis.invert_yaxis()
    axis.set_xlabel("BIC minus that of the verdict (–)")
    return figure
