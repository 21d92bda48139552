"""The figure of a diagnosis that shows the coefficient of restitution as a law."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..discrepancy import Diagnosis
from ..discrepancy.terms import Where
from ..fitting import Fit
from ..fitting.engine import approach_speeds, state_size
from ..hybrid.surface import restitutions
from ..plotting.colours import IMPACT
from ..plotting.labels import labelled
from ..recordings.files import unit_of


RESTITUTION = (
    "Coefficient of restitution against approach speed: the textbook model, refitted "
    "(dashed), and the model with the missing effects (line), each with a band of "
    "twice the standard error (a band that the line would hide is given as a number "
    "in the legend). The marks at the bottom are the approach speeds of the "
    "recorded impacts, from the fitted flights; outside them, the law is extrapolated."
)

_SPEEDS = 60
# colour, line and label of both models
_LINES = (
    ("0.45", "--", "textbook model"),
    (IMPACT, "-", "with the missing effects"),
)
# half width of a band, relative to the axis, that is as wide as the line: 0.8 points of
# about 170
_VISIBLE = 0.8 / 170


class _Law(NamedTuple):
    """Coefficients of all gaps at some approach speeds, shape `(speeds, gaps)`."""

    value: Float[np.ndarray, "k m"]
    stderr: Float[np.ndarray, "k m"]


def has_law(found: Diagnosis) -> bool:
    """Return whether a missing effect changes the restitution as a function of the
    approach speed, at impacts that were measured.
    """
    named = any(one.where == Where.IMPACT and one.term for one in found.effects)
    free = any(
        one.kind == "restitution" and "speed" in one.arguments for one in found.missing
    )
    return (named or free) and bool(_speeds(found))


def restitution(plt, found: Diagnosis):
    """Return the figure, with one panel per gap whose coefficient depends on the
    approach speed; with all gaps if there is none.
    """
    recorded = _speeds(found)
    fastest = max(np.max(speeds) for speeds in recorded.values())
    along = np.linspace(0, 1.02 * fastest, _SPEEDS + 1)[1:]
    laws = (_law(found.before, along), _law(found.after, along))
    varies = np.ptp(laws[1].value, axis=0) > np.max(laws[1].stderr, axis=0)
    shown = [gap for gap in recorded if varies[gap]] or list(recorded)
    figure, axes = plt.subplots(
        1, len(shown), figsize=(max(5.0, 3.8 * len(shown)), 3.2),
        layout="constrained", squeeze=False,
    )  # fmt: skip
    unit = _unit(found)
    name = found.system().constraint_name
    for axis, gap in zip(axes.flat, shown):
        axis.set_xlim(0, 1.02 * np.max(recorded[gap]))
        curves = [(law.value[:, gap], 2 * law.stderr[:, gap]) for law in laws]
        low, high = _limits(curves)
        axis.set_ylim(low, high)
        for (value, band), (color, line, label) in zip(curves, _LINES):
            hidden = np.max(band) < _VISIBLE * (high - low)
            if hidden:
                label += f" ± {np.max(band):.1g}"
            axis.fill_between(
                along, value - band, value + band, color=color, alpha=0.3, lw=0
            )
            for edge in () if hidden else (value - band, value + band):
                axis.plot(along, edge, color=color, lw=0.6, alpha=0.8)
            axis.plot(along, value, line, color=color, label=label)
        axis.plot(
            recorded[gap], np.zeros_like(recorded[gap]), "|", color="k", ms=9,
            alpha=0.4, transform=axis.get_xaxis_transform(), label="recorded impacts",
        )  # fmt: skip
        axis.set_xlabel(labelled("approach speed", unit))
        if len(recorded) > 1:
            axis.set_title(name(gap))
        axis.legend(fontsize="small")
    axes[0, 0].set_ylabel("coefficient of restitution")
    return figure


def _limits(curves) -> tuple[float, float]:
    """Return limits of the vertical axis that contain all bands, with a margin.

    A fit that is not sound has no band.
    """
    wide = [(value, np.where(np.isfinite(band), band, 0)) for value, band in curves]
    low = min(float(np.min(value - band)) for value, band in wide)
    high = max(float(np.max(value + band)) for value, band in wide)
    room = max(0.08 * (high - low), 1e-3 * max(abs(low), abs(high)))
    return low - room, high + room


def _unit(found: Diagnosis) -> str:
    """Return the unit of the approach speeds, if all lengths have the same unit."""
    units = {unit_of(channel) for channel in found.after.problem.model.sensors}
    units = {unit for unit in units if "/" not in unit}
    return f"{units.pop()}/s" if len(units) == 1 else ""


def _speeds(found: Diagnosis) -> dict[int, Float[np.ndarray, " k"]]:
    """Return the approach speeds of the recorded impacts at each gap that has any."""
    fit = found.after
    side = np.concatenate([part.impacts.side for part in fit.problem.segments])
    speed = np.concatenate(approach_speeds(fit.problem, fit.point))
    known = np.isfinite(speed) & (speed > 0)
    return {int(gap): speed[known & (side == gap)] for gap in np.unique(side[known])}


def _law(fit: Fit, along: Float[np.ndarray, " k"]) -> _Law:
    """Return the coefficients of a fitted model, as in its first recording."""
    drive = fit.problem.segments[0].drive

    def law(values, layout, state):
        model = layout.at(values)
        system = model.system if drive is None else model.uniform(0.0, drive.speed)
        zero = jnp.zeros(())
        found = jax.vmap(lambda one: restitutions(system, zero, state, one))(along)
        return found, found

    # without the states of sensor filters
    state = fit.point.states[0, 0, : state_size(fit.problem.model)]
    given = fit.point.values[0], fit.problem.layout, state
    slopes, value = eqx.filter_jit(jax.jacfwd(law, has_aux=True))(*given)
    own = fit.problem.records[0]
    rows = [k for k, one in enumerate(fit.estimates) if one.record in (None, own)]
    names = [one.name for one in fit.problem.parameters]
    columns = [names.index(fit.estimates[k].name) for k in rows]
    covariance = fit.covariance[np.ix_(rows, rows)]
    push = np.asarray(slopes)[..., columns]
    variance = np.einsum("kmp,pq,kmq->km", push, covariance, push)
    return _Law(np.asarray(value), np.sqrt(np.maximum(variance, 0.0)))
