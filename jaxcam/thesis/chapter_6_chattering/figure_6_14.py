"""Figure 6.14: predicted and simulated state at the section after a change of D*."""

import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from variational import simulated_at_section

from ...models import CamFollower
from ..remember import remembered
from ..target import Rows, Target
from .rebuilt import composed_at, draw_rebuilt, lobe_rows, Rebuilt


@remembered
def rebuilt_state(system: CamFollower) -> Rebuilt:
    """Compute the data of Figure 6.14, in which the rebound speed of D* is changed."""
    rig, composed = composed_at(system, late=False)
    bar = float(composed.lambda_bar)
    lam = np.linspace(0.85 * bar, 0.40, 400)
    change = jnp.asarray((lam - bar) / float(composed.covector[0]))
    predicted = np.asarray(composed.at_section(change))  # pyright: ignore
    section = simulated_at_section(rig, composed, change)
    simulated = np.stack([np.asarray(section.gap), np.asarray(section.velocity)], 1)
    return Rebuilt(np.asarray(change), predicted, simulated, composed)


def compute(system: CamFollower) -> Rows:
    found = rebuilt_state(system)
    return lobe_rows(found)


def draw(system: CamFollower) -> Figure:
    found = rebuilt_state(system)
    return draw_rebuilt(found, "change of the rebound speed (mrad/s)", 1e3)


TARGET = Target("Section after a change of state", compute, draw)
