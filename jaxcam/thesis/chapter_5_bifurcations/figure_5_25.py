"""Figure 5.25: the reference state, and the lobes around it."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import fit_local_map
from variational.chatter import Lobes, LocalMap

from ... import plotting
from ...models import CamFollower
from ..interruption import sticking_state
from ..remember import remembered
from ..target import Rows, Target
from .table_5_3 import lobes_of, M, map_rig


@remembered
def measured(system: CamFollower) -> tuple[Lobes, LocalMap]:
    """Return the lobes of Figure 5.25 and the map fitted to them."""
    lobes = lobes_of(system)
    return lobes, fit_local_map(lobes)


def compute(system: CamFollower) -> Rows:
    lobes, local = measured(system)
    state = sticking_state(map_rig(system))[0]
    apart = np.abs(np.diff(lobes.corners))
    rows: Rows = [
        ("angle of the reference state", 0.3371, state[0], "rad"),
        ("lobes resolved", np.nan, len(apart), ""),
    ]
    for k, ratio in enumerate(apart[1:] / apart[:-1]):
        name = f"width of lobe {k + 1} relative to lobe {k}"
        rows.append((name, np.exp(M), ratio, ""))
    del local
    return rows


def draw(system: CamFollower) -> Figure:
    lobes, fitted = measured(system)
    figure, ax = plt.subplots(figsize=(7.2, 5.0))
    plotting.local_map(fitted, lobes, ax)
    ax.set_xlabel("angle at the section (rad)")
    ax.set_ylabel("angle one cycle later (rad)")
    return figure


TARGET = Target("The measured local map", compute, draw)
