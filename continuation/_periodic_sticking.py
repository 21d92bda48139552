"""Orbits that stick once a forcing period: explicit, because sticking forgets."""

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import contact_acceleration, HybridSystem
from variational._chatter_frame import chatter_frame
from variational._chatter_orbit import chatter_accumulation

from ._problem import AbstractProblem, Monitor, Stability


#: names of the monitors
CHATTER = "chatter margin"
DETACHMENT = "contact acceleration"
_GRID = 128


class StickingOrbits(AbstractProblem):
    """P(inf, 1): the orbit that leaves contact, chatters and sticks in each period.

    While it sticks it follows the constraint, so it starts each turn at the release
    point without relative velocity and needs no equation to be solved: the unknowns are
    the state at release, shape `(2,)`, and all multipliers are zero. Where it exists
    depends on two monitors:

    - the margin of [`variational.chatter_accumulation`][], zero where the impacts
      accumulate at the very moment of release. The sticking time itself falls to zero
      there like a power and does not change sign (the thesis, 3.5.1); the margin is
      smooth.
    - the largest acceleration that contact suppresses, zero where contact would never
      end: impacts begin there.

    **Arguments:** a system with a period, two states and one constraint.
    """

    stability: ClassVar[Stability] = "map"

    parameters: HybridSystem

    def residual(self, u, parameters) -> Float[Array, " n"]:
        return u - chatter_frame(parameters).state

    def jacobian(self, u, parameters):
        del parameters
        return jnp.eye(u.shape[0])

    def linearisation(self, u, parameters, jacobian) -> Float[Array, "n n"]:
        """Zero: nothing of a deviation survives sticking."""
        del u, parameters
        return jnp.zeros_like(jacobian)

    @property
    def normal_forms(self) -> bool:
        return False

    @property
    def detects(self) -> bool:
        return False

    def monitor(self, u, parameters) -> dict[str, Float[Array, ""]]:
        turn = chatter_accumulation(parameters)
        return {
            CHATTER: -turn.margin,
            DETACHMENT: largest_contact_acceleration(parameters, u),
        }

    def monitors(self) -> Mapping[str, Monitor]:
        return {
            CHATTER: Monitor(kind="interruption of chattering", ends=True),
            DETACHMENT: Monitor(kind="beginning of impacts", ends=True),
        }

    def observe(self, u, parameters) -> dict[str, Array]:
        """Period, release, accumulation and sticking time (s), impacts listed."""
        turn = chatter_accumulation(parameters)
        period = jnp.asarray(parameters.period, dtype=jnp.float64)
        return {
            "period": period,
            "time": turn.frame.release,
            "state": turn.frame.state,
            "accumulation": turn.accumulation,
            "sticking time": turn.frame.release + period - turn.accumulation,
            "impacts": turn.impacts,
        }

    def check(self, point: Any) -> str | None:
        value = point.tests.get(CHATTER, np.nan)
        if np.isfinite(value) and value < 0:
            return "chattering does not come to its end before contact is released"
        if point.tests.get(DETACHMENT, 1.0) < 0:
            return "contact never ends, so there are no impacts"
        return None

    @property
    def signature(self) -> str:
        return "sticks once a period"


def largest_contact_acceleration(system: HybridSystem, guess) -> Float[Array, ""]:
    """Largest acceleration that contact suppresses in a period; contact lasts below 0.

    Differentiable: at the maximum its time does not matter to first order.
    """
    period = system.period
    grid = period * jnp.arange(_GRID) / _GRID

    def at(system, t):
        return contact_acceleration(system, t[None], guess)[0]

    still = jax.lax.stop_gradient(system)
    values = contact_acceleration(still, jax.lax.stop_gradient(grid), guess)
    time = jax.lax.stop_gradient(grid[jnp.argmax(values)])

    def slope(t):
        return jax.jvp(lambda s: at(still, s), (t,), (jnp.ones_like(t),))[1]

    h = jax.lax.stop_gradient(period) / _GRID

    def newton(_, t):
        value, rate = jax.jvp(slope, (t,), (jnp.ones_like(t),))
        move = -value / jnp.where(rate < 0, rate, -jnp.inf)
        return t + jnp.clip(move, -h, h)

    time = jax.lax.stop_gradient(jax.lax.fori_loop(0, 4, newton, time))
    return at(system, time)


def on_release(system: HybridSystem) -> tuple[StickingOrbits, np.ndarray]:
    """The problem of the orbit that sticks once a period, and its state.

    **Raises:** `ValueError` where contact never ends, or is never made.
    """
    frame = _frame(system)
    if not bool(jnp.isfinite(frame.release)):
        raise ValueError(
            "this system has no release from contact in its period, so no orbit sticks "
            "for a part of it; check the parameters"
        )
    return StickingOrbits(system), np.asarray(frame.state)


@eqx.filter_jit
def _frame(system):
    return chatter_frame(system)
