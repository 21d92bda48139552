"""Figure 5.26: the order of the events in two neighbouring lobes."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational.chatter import LocalMap

from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT, RECORDED
from ..target import Rows, Target
from .figure_5_25 import measured


class LobeEvents(NamedTuple):
    """Shifts (rad) of the map at which the fixed points of a lobe change."""

    fold: float
    border: float
    """Shift at which the fixed point of the inner lobe ends at the common corner."""
    flip: float


def lobe_events(local: LocalMap, number: int) -> LobeEvents:
    """Return the events of one lobe as the map is shifted.

    A fixed point of x -> Pi(x + s) at y = x + s belongs to the shift s = y - Pi(y): the
    fold is where the slope at y is 1, the flip where it is -1.
    """
    beta = np.exp(float(local.M) * np.arange(number + 2))
    corners = float(local.x_inf) + (float(local.x_0 - local.x_inf)) * beta
    outer, inner = corners[number], corners[number + 1]
    share = np.linspace(0, 1, 20001)[1:-1] ** 2
    y = outer + share * (inner - outer)
    slope = np.asarray(jax.vmap(jax.grad(lambda x: local(x).sum()))(jnp.asarray(y)))
    shift = y - np.asarray(local(jnp.asarray(y)))

    def where(value):
        k = np.flatnonzero((slope[1:] - value) * (slope[:-1] - value) <= 0)
        return float(shift[k[0]]) if len(k) else np.nan

    # just inside the corner, where the square root of the inner lobe begins
    edge = inner - 1e-9 * abs(outer - inner)
    border = edge - float(local(jnp.asarray(edge)))
    return LobeEvents(where(1.0), border, where(-1.0))


def compute(system: CamFollower) -> Rows:
    _, local = measured(system)
    rows: Rows = []
    start = float(local.x_inf - local.alpha_inf)
    inner, outer = lobe_events(local, 1), lobe_events(local, 0)
    named = [
        ("(b) fold: two fixed points in the lobe", inner.fold),
        ("(c) the fixed point of the inner lobe ends at the corner", inner.border),
        ("(d) flip: period doubling in the lobe", inner.flip),
        ("(e) fold in the next lobe", outer.fold),
        ("(f) the fixed point of the lobe ends at the corner", outer.border),
    ]
    ordered = all(
        one < other for (_, one), (_, other) in zip(named[:-1], named[1:], strict=True)
    )
    rows.append(("events in the printed order (1: yes)", 1, ordered, ""))
    for name, shift in named:
        rows.append((f"{name}: shift from the onset", np.nan, shift - start, "rad"))
    return rows


def _map_with_identity(ax, fitted, shift, low, high) -> None:
    # equal steps in the cube root of the distance from x_0, where the slope is infinite
    x = float(fitted.x_0) - (float(fitted.x_0) - low) * np.linspace(0, 1, 6001) ** 3
    value = np.asarray(fitted(jnp.asarray(x)))
    shown = (x > low) & (x < high)
    ax.plot(x[shown] - shift, value[shown], color=FLIGHT, lw=1.6)
    ends = np.array([low, high]) - shift
    ax.plot(ends, ends, "--", color=RECORDED, lw=1.2)


def draw(system: CamFollower) -> Figure:
    _, fitted = measured(system)
    inner, outer = (lobe_events(fitted, k) for k in (1, 0))
    shifts = (
        ("(a) before", inner.fold - 0.3 * (inner.border - inner.fold)),
        ("(b) fold", inner.fold),
        ("(c) end at the corner", inner.border),
        ("(d) flip", inner.flip),
        ("(e) fold in the next lobe", outer.fold),
        ("(f) end at the corner", outer.border),
    )
    figure, axes = plt.subplots(2, 3, figsize=(10.5, 6.6))
    x_0, x_inf = float(fitted.x_0), float(fitted.x_inf)
    for ax, (name, shift) in zip(axes.flat, shifts, strict=True):
        _map_with_identity(ax, fitted, shift, x_inf - 0.3 * (x_0 - x_inf), x_0)
        # mark the points at which the map intersects the identity
        y = x_0 - (x_0 - x_inf) * np.linspace(1e-7, 1 - 1e-7, 40001) ** 2
        apart = y - np.asarray(fitted(jnp.asarray(y))) - shift
        near = np.flatnonzero(apart[1:] * apart[:-1] <= 0)
        ax.plot(y[near] - shift, y[near] - shift, "o", color=IMPACT, ms=4.5)
        image = np.asarray(fitted(jnp.asarray(y)))
        low, high = np.nanmin(image), np.nanmax(image)
        room = 0.08 * (high - low)
        ax.set_ylim(low - room, high + room)
        ax.set_xlim(low - 2 * room, high + 4 * room)
        ax.set_title(name)
        ax.tick_params(labelbottom=False, labelleft=False)
    figure.supxlabel("angle at the section")
    figure.supylabel("one cycle later")
    return figure


TARGET = Target("Events of the local map", compute, draw)
