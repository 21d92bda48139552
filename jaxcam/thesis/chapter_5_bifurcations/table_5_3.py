"""Table 5.3: constants of the local map at the interruption of chatter.

The polynomial is compared by its value in the middle of the first lobe: the terms with
the printed coefficients, in powers of about 0.34 rad, cancel to one part in a million.
"""

import jax.numpy as jnp
import numpy as np

from variational import chatter_frame, find_lobes, fit_local_map, scaling_law
from variational.chatter import Lobes

from ...models import CamFollower
from ..interruption import beside_interruption, sticking_state
from ..progress import of_share
from ..remember import remembered
from ..speeds import at_rpm
from ..target import Rows, Target


_MAP_SPEED = 152.6
"""Speed at which Figure 5.25 is drawn (rpm)."""
_PERCENT = 1.0
"""Range of the perturbations of the angle in Figure 5.25 (%)."""
_DOUBLED = 4
"""Number of times that the range may be doubled for a rig with different lobes."""
Q, M, DELTA_PI, DELTA_X = -0.62, -0.535, 2.243e-4, 1.022e-3
CUBIC = (1695.91, -15119.51, 44927.06, -44486.71)
ROOT, X_0, P_0, ALPHA, X_INF = 0.12089, 0.33964, 0.33667, 0.33715, 0.33717


def map_rig(system: CamFollower) -> CamFollower:
    """Return the rig at the speed of Figure 5.25, just below its interruption."""
    return at_rpm(system, beside_interruption(system, _MAP_SPEED))


@remembered
def lobes_of(system: CamFollower, most: int = 6) -> Lobes:
    """Return the lobes of Figure 5.25 for this rig."""
    system = map_rig(system)
    state = sticking_state(system)[0]
    span = _PERCENT / 100 * float(state[0])
    for doubled in range(_DOUBLED + 1):
        deviations = 2**doubled * np.linspace(-span / 4, span, 320)
        try:
            share = of_share("measuring lobes")
            return find_lobes(system, state, deviations, most=most, progress=share)
        except ValueError:
            if doubled == _DOUBLED:
                raise
    raise AssertionError


def compute(system: CamFollower) -> Rows:
    lobes = lobes_of(system)
    local = fit_local_map(lobes)
    release = chatter_frame(map_rig(system))
    law = scaling_law(release.restitution)
    middle = X_0 - DELTA_X / 2
    polynomial = np.polyval(CUBIC[::-1], middle) + ROOT * np.sqrt(DELTA_X / 2)
    own = float(local.lobe(local.x_0 - local.delta_x / 2))
    return [
        ("Q", Q, local.Q, ""),
        ("M", M, local.M, ""),
        ("Q, theory: log p^2", Q, jnp.log(law.p**2), ""),
        ("M, theory: log q", M, jnp.log(law.q), ""),
        ("height of the first lobe", DELTA_PI, local.delta_pi, "rad"),
        ("width of the first lobe", DELTA_X, local.delta_x, "rad"),
        ("p in the middle of the first lobe", polynomial, own, "rad"),
        ("d", ROOT, local.root, "rad^(1/2)"),
        ("x_0", X_0, local.x_0, "rad"),
        ("p(x_0)", P_0, local.p_0, "rad"),
        ("alpha_inf", ALPHA, local.alpha_inf, "rad"),
        ("alpha_inf, from the motion", ALPHA, lobes.limit, "rad"),
        ("x_inf", X_INF, local.x_inf, "rad"),
        ("x_inf, from the motion", X_INF, lobes.accumulation, "rad"),
    ]


TARGET = Target("Local map at the interruption of chatter", compute)
