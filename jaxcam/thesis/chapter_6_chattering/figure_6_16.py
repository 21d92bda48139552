"""Figure 6.16: one cycle of the composed map, without the printed scale factors."""

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from variational import section_turn

from ...hybrid.programs import program
from ...models import CamFollower
from ..remember import remembered
from ..target import Rows, Target
from .rebuilt import composed_at, draw_rebuilt, lobe_rows, Rebuilt


@remembered
def rebuilt_turn(system: CamFollower) -> Rebuilt:
    """Compute the data of Figure 6.16: the state at the section one turn after a
    deviation along the vector B; the deviation is given by its angle component (rad).
    """
    rig, composed = composed_at(system, late=True)
    change = np.linspace(-2e-5, 1e-4, 400)
    epsilon = jnp.asarray(change) / composed.vector[0]
    after = composed(epsilon)
    predicted = np.asarray(
        composed.relative + after[:, None] * composed.relative_vector
    )
    states = composed.state + epsilon[:, None] * composed.vector
    section = _turns(rig, states)
    simulated = np.stack([np.asarray(section.gap), np.asarray(section.velocity)], 1)
    return Rebuilt(change, predicted, simulated, composed)


@program
def _turns(rig, states):
    return jax.vmap(lambda state: section_turn(rig, state))(states)


def compute(system: CamFollower) -> Rows:
    found = rebuilt_turn(system)
    return lobe_rows(found)


def draw(system: CamFollower) -> Figure:
    found = rebuilt_turn(system)
    return draw_rebuilt(found, "deviation of the angle (mrad)", 1e3)


TARGET = Target("Section after a complete cycle", compute, draw)
