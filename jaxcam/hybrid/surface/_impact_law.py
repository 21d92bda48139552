"""Compute the coefficient of restitution of a system's impact law."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._system import HybridSystem
from ._normal import gaps, normal_velocity
from ._rounding import speed_rounding


# tolerated rounding error of an impact law that is evaluated in several coordinates
_ROUNDING = 1e-6
# a normal velocity of this multiple of its rounding error gives accurate coefficients
_KNOWN = 1e7
# Newton steps from the state to the constraint
_STEPS = 4


def restitutions(
    system: HybridSystem, t, x: Float[Array, " n"], approach=None
) -> Float[Array, " m"]:
    """Return the coefficient of restitution of each constraint near a state.

    The state is moved onto the constraint, and its normal velocity is made negative:
    the coefficient is minus the ratio of the normal velocities after and before an
    impact (thesis, eq. 2.27). For a state at rest on the constraint, the normal
    velocity is only rounding error, so it is replaced by a larger value, or by 1 if it
    is exactly zero and has no rounding error. The law is `system.impact`, without
    contact friction: with Poisson's or Stronge's coefficient, friction may increase the
    ratio of the normal velocities above one.

    Args:
        system: The system.
        t: Time.
        x: State, shape `(n,)`.
        approach: Approach speed of the impacts, positive; by default the speed of the
            state.
    """
    number = gaps(system, t, x).shape[0]
    found = []
    for k in range(number):
        y = x
        for _ in range(_STEPS):
            gap, slope = jax.value_and_grad(lambda y, k=k: gaps(system, t, y)[k])(y)
            y = y - gap * slope / jnp.sum(slope * slope)

        def speed(y, k=k):
            return normal_velocity(system, t, y)[k]

        value, slope = jax.value_and_grad(speed)(y)
        rounding = speed_rounding(system, t, y, jnp.abs(y))[k]
        size = jnp.maximum(jnp.abs(value), _KNOWN * rounding)
        wanted = -jnp.where(size == 0, 1.0, size) if approach is None else -approach
        y = y + (wanted - value) * slope / jnp.sum(slope * slope)
        after = jnp.atleast_2d(system.impact(t, y))[k]
        found.append(-speed(after) / speed(y))
    return jnp.stack(found) if found else jnp.zeros((0,))


def check_restitution(system: HybridSystem, values) -> None:
    """Raise `ValueError` for a coefficient outside [0, 1]; NaN is accepted.

    Args:
        system: The system, whose `active` allows values above one.
        values: Coefficients, shape `(m,)`, or `(lanes, m)` for trajectories with
            different parameters.
    """
    values = np.asarray(values)
    high = np.inf if system.active else 1.0 + _ROUNDING
    bad = np.argwhere((values < -_ROUNDING) | (values > high))
    if len(bad):
        which = tuple(int(k) for k in bad[0])
        at = f" at constraint {which[-1]}" if values.shape[-1] > 1 else ""
        lane = f" in trajectory {which[0]}" if values.ndim > 1 else ""
        raise ValueError(
            "Choose a coefficient of restitution between 0 and 1; it is "
            f"{float(values[which]):.6g}{at}{lane}."
        )
