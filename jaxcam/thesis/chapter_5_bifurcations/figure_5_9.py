"""Figure 5.9: impacts per cycle, and completeness of chatter."""

import equinox as eqx
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ... import sweeps
from ...hybrid import Settings
from ...hybrid.programs import program
from ...hybrid.surface import normal_velocity
from ...models import CamFollower, rpm_to_rad_s
from ...plotting.colours import FLIGHT
from ..interruption import beside_interruption
from ..progress import of_sweep
from ..remember import remembered
from ..speeds import speed_of
from ..target import Rows, Target
from .figure_5_1 import KEEP, TURNS


_SPEEDS, _IMPACTS = (152.66, 152.882, 153.45), 1500
"""Printed speeds (rpm), and number of impacts drawn at each."""


def impact_speeds(system: CamFollower) -> list[float]:
    """Return the speeds (rpm) of Figure 5.9: one below and two above the
    interruption.
    """
    return [beside_interruption(system, rpm) for rpm in _SPEEDS]


@remembered
def impacts_at(system: CamFollower) -> sweeps.Diagram:
    """Return the impacts of Figure 5.9, which are resolved deep into the chatter; the
    motions start from contact at rest.
    """
    section = sweeps.ImpactSection(
        system, settings=Settings(tolerance=1e-9, chatter_depth=1e-4)
    )
    return sweeps.diagram(
        section,
        "speed",
        rpm_to_rad_s(np.array(impact_speeds(system))),
        turns=_IMPACTS,
        keep=_IMPACTS,
        progress=of_sweep("listing impacts"),
    )


def rebound_speeds(system: CamFollower, number: int) -> np.ndarray:
    """Return the normal velocity (rad/s) after each impact at one speed of Figure
    5.9.
    """
    made = impacts_at(system)
    rig = eqx.tree_at(speed_of, system, jnp.asarray(made.values[number]))
    times = made.dataset["time"].values[number, 0]
    states = made.states[number, 0]
    return np.asarray(_normal(rig.prepared(), jnp.asarray(times), jnp.asarray(states)))


@program
def _normal(rig, times, states):
    return jax.vmap(lambda t, x: normal_velocity(rig, t, x)[0])(times, states)


def compute(system: CamFollower) -> Rows:
    made = impacts_at(system)
    section = sweeps.Stroboscopic(system)
    each = impact_speeds(system)
    speeds = rpm_to_rad_s(np.array(each))
    starts = section.starts(speed_of, speeds)
    samples = section.sample(starts, TURNS, KEEP, where=speed_of, values=speeds)
    rows: Rows = []
    for k, (rpm, printed) in enumerate(zip(each, (1, np.nan, np.nan), strict=True)):
        share = np.mean(samples.rests[k] > 0)
        rows.append(
            (f"{rpm:g} rpm: fraction of the turns with sticking", printed, share, "")
        )
        phase = made.dataset["phase"].values[k, 0]
        spread = len(np.unique(np.round(phase[np.isfinite(phase)], 6)))
        rows.append((f"{rpm:g} rpm: distinct impact phases", np.nan, spread, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    made = impacts_at(system)
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.8))
    phase = made.dataset["phase"].values[:, 0]
    each = impact_speeds(system)
    for k, (ax, rpm) in enumerate(zip(axes, each, strict=True)):
        speeds = rebound_speeds(system, k)
        ax.semilogy(phase[k], speeds, ".", ms=3, color=FLIGHT)
        ax.set_title(f"{rpm:g} rpm")
        ax.set_xlabel("phase (turns)")
        ax.set_ylim(1e-6, 5)
    axes[0].set_ylabel("rebound speed (rad/s)")
    return figure


TARGET = Target("Impacts on the route to chaos", compute, draw)
