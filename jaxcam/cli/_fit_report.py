"""Tables and figures of `jaxcam fit`."""

from pathlib import Path

import matplotlib
from rich.table import Table


matplotlib.use("Agg")

from ..fitting import Bootstrap, Fit, Problem, residuals
from ..fitting.engine import nominal_of
from ..plotting.colours import CONTACT, FLIGHT
from ._residual_axes import Along, residual_label, shown_in, sides, title_of


def parameter_table(problem: Problem, found: Fit, again: Bootstrap | None) -> Table:
    """Tabulate nominal and fitted values with their errors."""
    table = Table(title="Parameters")
    table.add_column("parameter", no_wrap=True)
    headings = ["nominal", "tolerance", "fitted", "std. error"]
    if again is not None:
        headings.append("bootstrap")
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    for k, one in enumerate(found.estimates):
        parameter = problem.parameter(one.name)
        nominal = nominal_value(problem, one.name)
        cells = [
            f"{nominal:.4g}",
            f"{parameter.tolerance:.2g}",
            f"{one.value:.6g}",
            f"{one.stderr:.1e}",
        ]
        if again is not None:
            cells.append(f"{again.stderr[k]:.1e}")
        label = ", ".join(part for part in (one.unit, one.record) if part)
        table.add_row(f"{one.name} ({label})" if label else one.name, *cells)
    return table


def nominal_value(problem: Problem, name: str) -> float:
    """Return the nominal value of a parameter."""
    return nominal_of(problem, problem.names.index(name))


def correlation_table(found: Fit) -> Table:
    """Tabulate the strongest correlations between parameters."""
    table = Table(title="Strongest correlations")
    for heading in ("parameter", "other parameter"):
        table.add_column(heading, no_wrap=True)
    table.add_column("correlation", justify="right")
    names = [one.label for one in found.estimates]
    pairs = [
        (abs(found.correlation[i, k]), found.correlation[i, k], names[i], names[k])
        for i in range(len(names))
        for k in range(i)
    ]
    for _, value, one, other in sorted(pairs, reverse=True)[:6]:
        table.add_row(one, other, f"{value:+.4f}")
    return table


def draw(folder: Path, before: Fit, after: Fit) -> list[Path]:
    """Draw the residuals before and after the fit, against time and drive angle."""
    import matplotlib.pyplot as plt

    from ..plotting import save_figure, style

    with style():
        return _draw(plt, save_figure, folder, before, after)


def _draw(plt, save_figure, folder, before, after) -> list[Path]:
    every = residuals(before)
    pairs = list(zip(every, residuals(after)))
    along = Along(every)
    files = []
    for name, sideways in (("time", False), ("phase", True))[: 1 + along.turns]:
        figure, axes = plt.subplots(
            len(pairs), 2, figsize=(9, 1.6 * len(pairs) + 0.8), squeeze=False
        )
        for row, both in zip(axes, pairs):
            factor, _ = shown_in(both[0])
            for axis, part, when in zip(row, both, ("nominal", "fitted")):
                x = along.place(part) if sideways else part.time
                for resting in sides(every):
                    keep = part.resting == resting
                    axis.plot(
                        x[keep],
                        part.value[keep] * factor,
                        ".",
                        ms=1,
                        color=CONTACT if resting else FLIGHT,
                        label="contact" if resting else "flight",
                        rasterized=True,
                    )
                band = 2 * factor * part.noise
                axis.axhspan(-band, band, color="0.5", alpha=0.25, lw=0)
                axis.set_title(f"{title_of(part, every)}: {when}", fontsize=8)
            row[0].set_ylabel(residual_label(both[0]), fontsize=8)
        for axis in axes[-1]:
            axis.set_xlabel(along.label if sideways else "time (s)")
        axes[0, 0].legend(markerscale=6, fontsize=7)
        files.append(save_figure(figure, folder / f"residuals_{name}.png"))
    return files
