"""Differentiate motions of Filippov systems, which cross a surface or slide on it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.filippov import FilippovSystem, FilippovTrajectory
from jaxcam.filippov.flows import leg_flow
from jaxcam.filippov.modes import mode_field


def filippov_saltation(
    system: FilippovSystem, t, state: Float[Array, " n"], before: int, after: int
) -> Float[Array, "n n"]:
    """Return the saltation matrix of a switch of a Filippov system.

    With F- and F+ the active fields before and after, the matrix at a crossing and at
    the start of sliding is

        S = I + (F+ - F-) H_x / (H_t + H_x F-).

    At the start of sliding, its rank falls by one, because the perturbation is
    projected onto the surface. At the end of sliding, one field has become tangent, F+
    = F-, and S is the identity. (R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations
    of Non-Smooth Mechanical Systems, 2004, chapter 7)

    Args:
        system: The system.
        t: Time of the switch (s).
        state: State at the switch, shape `(n,)`.
        before: Mode before the switch: 1 above, 0 sliding, -1 below.
        after: Mode after the switch.

    Returns:
        Shape `(n, n)`.

    Examples:
        >>> from jaxcam.models import BeltOscillator
        >>> from variational import filippov_saltation
        >>> state = jnp.array([0.0, 0.2])
        >>> filippov_saltation(BeltOscillator(), 0.0, state, -1, 0).shape
        (2, 2)
    """
    t = jnp.asarray(t, dtype=float)
    old = mode_field(system, jnp.asarray(float(before)), t, state)
    new = mode_field(system, jnp.asarray(float(after)), t, state)
    identity = jnp.eye(state.shape[0])
    if before == 0:
        return identity
    moved = (jnp.ones_like(t), old)
    _, speed = jax.jvp(system.switching, (t, state), moved)
    normal = jax.grad(system.switching, argnums=1)(t, state)
    return identity + jnp.outer(new - old, normal) / speed


def filippov_monodromy(trajectory: FilippovTrajectory) -> Float[Array, "n n"]:
    """Return the derivative of the state at the end of a run with respect to that at
    its start.

    It is the product of the derivatives of the flow between switches and the saltation
    matrices at the switches. Over one period of a periodic motion, its eigenvalues are
    the Floquet multipliers, and each sliding interval contributes a zero multiplier. If
    the run starts in sliding, the initial state is varied only along the surface.

    Args:
        trajectory: A run of [`jaxcam.filippov.simulate_filippov`][].

    Returns:
        Shape `(n, n)`.

    Examples:
        >>> from jaxcam.filippov import simulate_filippov
        >>> from jaxcam.models import BeltOscillator
        >>> from variational import filippov_monodromy
        >>> run = simulate_filippov(BeltOscillator(), jnp.array([1.0, 0.0]), 0.0, 1.0)
        >>> filippov_monodromy(run).shape
        (2, 2)
    """
    system, switches = trajectory.system, trajectory.switches
    modes = np.append(np.asarray(trajectory.mode)[0], np.asarray(switches.after))
    times = [float(trajectory.t0), *map(float, switches.time), float(trajectory.t1)]
    states = [trajectory.state[0], *switches.state]
    matrix = jnp.eye(trajectory.state.shape[1])
    for k, mode in enumerate(modes):
        span = jnp.asarray(times[k]), jnp.asarray(times[k + 1])
        matrix = _leg(system, jnp.asarray(float(mode)), states[k], *span) @ matrix
        if k < len(switches.time):
            before, after = int(switches.before[k]), int(switches.after[k])
            point = switches.time[k], switches.state[k]
            matrix = filippov_saltation(system, *point, before, after) @ matrix
    return matrix


_STEPS = 256


@eqx.filter_jit
def _leg(system, mode, state, t0, t1):
    return jax.jacfwd(lambda x: leg_flow(system, mode, x, t0, t1, _STEPS))(state)
