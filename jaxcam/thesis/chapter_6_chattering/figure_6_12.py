"""Figure 6.12: the jerk at zero relative acceleration."""

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...hybrid.surface import contact_state, normal_acceleration
from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT, RECORDED, SECTION
from ...plotting.curves import trajectory_curve
from ..orbits import NEAR_CAM
from ..remember import remembered
from ..target import Rows, Target
from .sequence import sequence, sticking_turn
from .table_6_1 import RELEASE
from .table_6_2 import JERK


@remembered
def contact_derivatives(system: CamFollower):
    """Return times in one turn (s), and relative acceleration and jerk in contact."""
    found = sequence(system)
    rig = found.system.prepared()
    times = jnp.linspace(0.0, float(rig.period), 2001)

    def acceleration(t):
        state = contact_state(rig, t[None], jnp.array(NEAR_CAM))[0]
        return normal_acceleration(rig, t, state)[0]

    both = jax.vmap(lambda t: jax.jvp(acceleration, (t,), (jnp.ones_like(t),)))(times)
    return tuple(np.asarray(v) for v in (times, *both))


def compute(system: CamFollower) -> Rows:
    times, acceleration, jerk = contact_derivatives(system)
    k = np.flatnonzero((acceleration[:-1] < 0) & (acceleration[1:] >= 0))
    release, c = np.nan, np.nan
    if len(k):
        share = -acceleration[k[0]] / (acceleration[k[0] + 1] - acceleration[k[0]])
        release = times[k[0]] + share * (times[1] - times[0])
        c = jerk[k[0]] + share * (jerk[k[0] + 1] - jerk[k[0]])
    return [
        ("c, the jerk at zero acceleration", JERK, c, "rad/s^3"),
        ("time of release", RELEASE[0], release, "s"),
        ("c, from the release point", JERK, sequence(system).frame.jerk, "rad/s^3"),
    ]


def draw(system: CamFollower) -> Figure:
    times, acceleration, jerk = contact_derivatives(system)
    drawn = trajectory_curve(sticking_turn(system), None, 3000)
    found = sequence(system)
    period = float(found.system.period)
    release = float(found.frame.release) % period
    figure, axes = plt.subplots(2, 1, figsize=(8.0, 5.6), sharex=True)
    axes[0].plot(drawn.time, drawn.gap[:, 0], color=FLIGHT)
    axes[0].set_ylabel("gap (rad)")
    axes[1].plot(times, acceleration, color=FLIGHT, label="acceleration (rad/s²)")
    axes[1].plot(times, jerk / 10, "--", color=IMPACT, label="jerk / 10 (rad/s³)")
    axes[1].plot(release, float(found.frame.jerk) / 10, "*", color=SECTION, ms=12,
                 label="c / 10 at release")  # fmt: skip
    axes[1].axhline(0, color="0.4", lw=0.7)
    for ax in axes:
        ax.axvline(release, color=RECORDED, ls=":", lw=1.2)
    axes[1].set_xlim(0, period)
    axes[1].set_ylabel("in contact (–)")
    axes[1].set_xlabel("time (s)")
    axes[1].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
    return figure


TARGET = Target("The jerk at release", compute, draw)
