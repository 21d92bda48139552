"""Figure 1.3: sticking at 152.65 rpm, none at 152.69 rpm."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...models import CamFollower, rad_s_to_rpm
from ...plotting.colours import FLIGHT, SECOND
from ..interruption import beside_interruption, INTERRUPTION, interruption
from ..releases import draw_turn, released_turn, sticking_time
from ..target import Rows, Target


_COMPLETE, _INTERRUPTED = 152.65, 152.69
"""Printed speeds of Figure 1.3 (rpm), on either side of the interruption."""


def both_sides(system: CamFollower) -> tuple[float, float]:
    """Return the speeds (rpm) of Figure 1.3; the first is also that of Figure 1.2."""
    complete = beside_interruption(system, _COMPLETE)
    return complete, beside_interruption(system, _INTERRUPTED)


def compute(system: CamFollower) -> Rows:
    rig = interruption(system)
    rows: Rows = [("interruption", INTERRUPTION, rad_s_to_rpm(rig.speed), "rpm")]
    for rpm, printed in zip(both_sides(system), (np.nan, 0.0), strict=True):
        run = released_turn(system, rpm)
        rows.append((f"sticking time at {rpm:g} rpm", printed, sticking_time(run), "s"))
    return rows


def draw(system: CamFollower) -> Figure:
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 6.4))
    complete, interrupted = both_sides(system)
    for rpm, colour, dashes in (
        (complete, FLIGHT, "solid"),
        (interrupted, SECOND, "dashed"),
    ):
        run = released_turn(system, rpm)
        for ax in axes:
            draw_turn(run, ax, f"{rpm:g} rpm", colour, dashes)
    period = 60 / complete
    axes[1].set_xlim(0.97 * period, 1.02 * period)
    axes[1].set_ylim(-2e-7, 4e-6)
    axes[0].legend()
    return figure


TARGET = Target("Complete and interrupted chatter", compute, draw)
