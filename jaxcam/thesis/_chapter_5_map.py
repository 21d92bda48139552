"""Figures 5.25 to 5.28: the local map, measured, explained and iterated."""

from typing import Any, NamedTuple, TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from variational import (
    composed_map,
    find_lobes,
    fit_local_map,
    iterate_local_map,
    Lobes,
    LocalMap,
)

from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._chapter_5_diagrams import onset
from ._chatter import at_speed, interruption, pick_speed, sticking_state
from ._frame import frame
from ._remember import remembered
from ._table_5_3 import DELTA_X, lobes_of, M, map_rig, X_0


if TYPE_CHECKING:
    import pandas as pd


_NAN = float("nan")
#: number of the impact that the local theory starts from (docs/chatter.md)
_RANK = 37
#: distances (rpm) from the interruption at which map and motion are compared
_AFTER = 0.05, 0.1, 0.15
_SHIFTS = 600


@remembered
def measured(system: CamFollower) -> tuple[Lobes, LocalMap]:
    """The lobes of Figure 5.25 and the map fitted to them."""
    lobes = lobes_of(system)
    return lobes, fit_local_map(lobes)


def figure_5_25(system: CamFollower) -> "pd.DataFrame":
    """Figure 5.25: the state that is deviated from, and the lobes around it."""
    lobes, local = measured(system)
    state = sticking_state(map_rig(system))[0]
    apart = np.abs(np.diff(lobes.corners))
    rows: list[tuple[str, Any, Any, str]] = [
        ("angle that is deviated from", 0.3371, state[0], "rad"),
        ("lobes told apart", _NAN, len(apart), ""),
    ]
    for k, ratio in enumerate(apart[1:] / apart[:-1]):
        name = f"width of lobe {k + 1} over lobe {k}"
        rows.append((name, np.exp(M), ratio, ""))
    del local
    return frame(rows)


class LobeEvents(NamedTuple):
    """Shifts (rad) of the map at which the fixed points of a lobe change."""

    fold: float
    #: where the fixed point of the lobe inside it is lost at their common corner
    border: float
    flip: float


def lobe_events(local: LocalMap, number: int) -> LobeEvents:
    """Events of one lobe as the map moves sideways.

    A fixed point of x -> Pi(x + s) at y = x + s belongs to the shift s = y - Pi(y):
    fold and flip are where the slope at y is 1 and -1.
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
        return float(shift[k[0]]) if len(k) else _NAN

    # just inside the corner, where the root of the inner lobe begins
    edge = inner - 1e-9 * abs(outer - inner)
    border = edge - float(local(jnp.asarray(edge)))
    return LobeEvents(where(1.0), border, where(-1.0))


def figure_5_26(system: CamFollower) -> "pd.DataFrame":
    """Figure 5.26: the order of the events, in two lobes next to each other."""
    _, local = measured(system)
    rows: list[tuple[str, Any, Any, str]] = []
    start = float(local.x_inf - local.alpha_inf)
    inner, outer = lobe_events(local, 1), lobe_events(local, 0)
    named = [
        ("(b) fold: two fixed points in the lobe", inner.fold),
        ("(c) the one of the lobe inside it ends at the corner", inner.border),
        ("(d) flip: period doubling in the lobe", inner.flip),
        ("(e) fold in the next lobe", outer.fold),
        ("(f) the one of the lobe ends at the corner", outer.border),
    ]
    ordered = all(
        one < other for (_, one), (_, other) in zip(named[:-1], named[1:], strict=True)
    )
    rows.append(("events in the printed order (1: yes)", 1, ordered, ""))
    for name, shift in named:
        rows.append((f"{name}: shift from the onset", _NAN, shift - start, "rad"))
    return frame(rows)


def figure_5_27(system: CamFollower) -> "pd.DataFrame":
    """Figure 5.27: corners of the lobes, by (5.4) with Table 5.3 and as measured.

    Distances from x_0, since the printed map is placed elsewhere (docs/chatter.md).
    """
    lobes, _ = measured(system)
    rows = []
    for j in range(1, min(5, len(lobes.corners))):
        formula = DELTA_X * (1 - np.exp(j * M)) / (1 - np.exp(M))
        found = lobes.corners[0] - lobes.corners[j]
        rows.append((f"x_0 - x_{j}", formula, found, "rad"))
    whole = DELTA_X / (1 - np.exp(M))
    found = lobes.corners[0] - lobes.accumulation
    rows.append(("x_0 - x_inf", whole, found, "rad"))
    rows.append(("x_0", X_0, lobes.corners[0], "rad"))
    return frame(rows)


class Iterated(NamedTuple):
    """Figure 5.28: the fitted map beside the motion, both from the sticking state."""

    #: (k,) rpm; (k, kept) rad
    speeds: np.ndarray
    attractor: np.ndarray
    motion_speeds: np.ndarray
    motion: np.ndarray
    #: rad by rpm
    rate: float
    #: rpm
    interruption: float


@remembered
def iterated(system: CamFollower, size: str) -> Iterated:
    """The map along the direction in which motions leave the lobes, and the motion."""
    rig = interruption(system)
    composed = composed_map(rig, pick_speed, _RANK)
    per_rpm = float(rpm_to_rad_s(1.0))
    along = float(composed.incidence * composed.vector[0] / composed.feedback)
    rate = along * per_rpm
    span = 1e-3
    deviations = np.linspace(-span / 4, span, 320)
    lobes = find_lobes(
        rig, composed.state, deviations, direction=composed.vector, most=6
    )
    local = fit_local_map(lobes)
    end = float(rad_s_to_rpm(rig.speed))
    made = onset(system, size)
    speeds = np.asarray(rad_s_to_rpm(made.values))
    fine = np.linspace(speeds[0], speeds[-1], _SHIFTS)
    start = float(local.x_inf - local.alpha_inf)
    shifts = start + rate * (fine - end)
    attractor = np.asarray(iterate_local_map(local, shifts)) - float(local.alpha_inf)
    rest = np.array(
        [float(sticking_state(at_speed(system, v))[0][0]) for v in made.values]
    )
    motion = made.states[:, 0, :, 0] - rest[:, None]
    return Iterated(fine, attractor, speeds, motion, rate, end)


def figure_5_28(system: CamFollower, size: str) -> "pd.DataFrame":
    """Figure 5.28: how wide the attractors of map and motion are.

    The thesis draws the map alone, over no scale of speeds.
    """
    found = iterated(system, size)
    rows: list[tuple[str, Any, Any, str]] = [
        ("shift of the map by the speed", _NAN, found.rate, "rad/rpm")
    ]
    for after in _AFTER:
        for word, speeds, states in (
            ("motion", found.motion_speeds, found.motion),
            ("map", found.speeds, found.attractor),
        ):
            near = np.abs(speeds - found.interruption - after) < 0.01
            rows += [
                (
                    f"{word}, {after} rpm on: lowest",
                    _NAN,
                    np.nanmin(states[near]),
                    "rad",
                ),
                (
                    f"{word}, {after} rpm on: highest",
                    _NAN,
                    np.nanmax(states[near]),
                    "rad",
                ),
            ]
    return frame(rows)
