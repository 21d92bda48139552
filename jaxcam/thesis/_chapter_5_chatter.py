"""Figures 5.9 and 5.24: impacts on the route to chaos, and the time of sticking."""

from typing import Any, TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from variational import chatter_accumulation, scaling_law

from .. import sweeps
from ..hybrid import normal_velocity, Settings
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ._chatter import beside_interruption, interruption
from ._frame import frame
from ._orbits import speed_of
from ._remember import remembered


if TYPE_CHECKING:
    import pandas as pd


#: cycles at each speed, and how many are looked at
TURNS, KEEP = 300, 100
#: Figure 5.9: printed speeds (rpm); Figure 5.24: one at which the time is given
_IMPACT_SPEEDS, _BELOW = (152.66, 152.882, 153.45), 152.65
_IMPACTS = 1500
_NAN = float("nan")


def impact_speeds(system: CamFollower) -> list[float]:
    """Speeds (rpm) of Figure 5.9: one below the interruption, two above it."""
    return [beside_interruption(system, rpm) for rpm in _IMPACT_SPEEDS]


@remembered
def impacts_at(system: CamFollower) -> sweeps.Diagram:
    """The impacts of Figure 5.9, from contact at rest, listed deep into chatter."""
    section = sweeps.ImpactSection(
        system, settings=Settings(tolerance=1e-9, chatter_depth=1e-4)
    )
    return sweeps.diagram(
        section,
        "speed",
        rpm_to_rad_s(np.array(impact_speeds(system))),
        turns=_IMPACTS,
        keep=_IMPACTS,
    )


def figure_5_9(system: CamFollower) -> "pd.DataFrame":
    """Figure 5.9: impacts a turn, and whether chattering is complete."""
    made = impacts_at(system)
    section = sweeps.Stroboscopic(system)
    each = impact_speeds(system)
    speeds = rpm_to_rad_s(np.array(each))
    starts = section.starts(speed_of, speeds)
    samples = section.sample(starts, TURNS, KEEP, where=speed_of, values=speeds)
    rows: list[tuple[str, Any, Any, str]] = []
    for k, (rpm, printed) in enumerate(zip(each, (1, _NAN, _NAN), strict=True)):
        share = np.mean(samples.rests[k] > 0)
        rows.append((f"{rpm:g} rpm: part of the turns that stick", printed, share, ""))
        phase = made.dataset["phase"].values[k, 0]
        spread = len(np.unique(np.round(phase[np.isfinite(phase)], 6)))
        rows.append((f"{rpm:g} rpm: different phases of impacts", _NAN, spread, ""))
    return frame(rows)


def rebound_speeds(system: CamFollower, number: int) -> np.ndarray:
    """Normal velocity (rad/s) after each impact of one speed of Figure 5.9."""
    made = impacts_at(system)
    rig = eqx.tree_at(speed_of, system, jnp.asarray(made.values[number]))
    times = made.dataset["time"].values[number, 0]
    states = made.states[number, 0]
    return np.asarray(_normal(rig.prepared(), jnp.asarray(times), jnp.asarray(states)))


@eqx.filter_jit
def _normal(rig, times, states):
    return jax.vmap(lambda t, x: normal_velocity(rig, t, x)[0])(times, states)


@eqx.filter_jit
def _sticking(system, speeds):
    def one(speed):
        rig = eqx.tree_at(speed_of, system, speed)
        found = chatter_accumulation(rig)
        return found.frame.release + rig.period - found.accumulation

    return jax.vmap(one)(speeds)


@remembered
def sticking_times(system: CamFollower) -> tuple[np.ndarray, np.ndarray, float]:
    """Speeds (rpm) up to the interruption, sticking times there (s), interruption.

    Exact, however short; the distances to the interruption are even in logarithm.
    """
    end = float(rad_s_to_rpm(interruption(system).speed))
    speeds = end - np.geomspace(20.0, 1e-5, 120)
    times = _sticking(system, jnp.asarray(rpm_to_rad_s(speeds)))
    return speeds, np.asarray(times), end


def figure_5_24(system: CamFollower) -> "pd.DataFrame":
    """Figure 5.24: the sticking time falls to zero like a power near a root."""
    speeds, times, end = sticking_times(system)
    near = (end - speeds < 1e-2) & (times > 0)
    power = np.polyfit(np.log(end - speeds[near]), np.log(times[near]), 1)[0]
    rig = interruption(system)
    law = scaling_law(rig.restitution(rig.speed, jnp.zeros(())))  # pyright: ignore
    kappa = float(law.kappa)
    below = beside_interruption(system, _BELOW)
    at = np.interp(below, speeds, times)
    return frame(
        [
            ("where sticking ends", 152.67, end, "rpm"),
            ("exponent of its fall (a square root in the text)", 0.5, power, ""),
            ("the same by theory, kappa/2", 0.5, kappa / 2, ""),
            (f"sticking time at {below:g} rpm", _NAN, at, "s"),
        ]
    )
