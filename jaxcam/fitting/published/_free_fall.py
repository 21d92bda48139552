"""Fit the ratio of inertia to stiffness to a free fall (thesis, section 4.6)."""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from variational.orbits import flight_end

from ...hybrid import HybridSystem
from ._published import fit_published, Published
from ._published_fit import PublishedFit


class FreeFall(eqx.Module):
    """A system and its state at release."""

    system: HybridSystem
    """The system."""
    state: Float[Array, " n"] | tuple[Float[Array, ""], ...]
    """Initial state, shape `(n,)`, or its components as a tuple."""


def fit_free_fall(
    system: HybridSystem,
    where: Callable[[Any], Any],
    times: Float[np.ndarray, " k"],
    measured: Float[np.ndarray, " k"],
    error: float,
    *,
    state: Float[np.ndarray, " n"],
    observe: int = 0,
    name: str = "stiffness",
    steps: int = 4,
) -> PublishedFit:
    """Fit one parameter, and the initial state, to a motion without contact.

    The motion of the rig depends on the inertia J and the stiffness K only through
    their ratio M = J/K (thesis, eq. 4.9): select one of them with `where`; the other is
    fixed.

    Args:
        system: The system.
        where: Selects the parameter of the system.
        times: Times (s), increasing, before the first impact, shape `(k,)`.
        measured: One component of the state at these times, shape `(k,)`.
        error: Standard error of a sample, in the unit of the component.
        state: Initial guess for the state at `times[0]`, shape `(n,)`.
        observe: Index of the measured component.
        name: Name of the parameter for the report.
        steps: Number of eighth-order Runge-Kutta steps between two samples.

    Returns:
        A [`jaxcam.fitting.published.PublishedFit`][] whose `model` has the fields
            `system` and `state`.

    Raises:
        ValueError: The times do not increase.

    Examples:
        >>> from jaxcam.fitting.published import fit_free_fall
        >>> from jaxcam.models import BouncingBall
        >>> times = np.linspace(0.0, 0.4, 9)
        >>> height, start = (1 - 4.905 * times**2).round(3), np.array([0.9, 0.0])
        >>> ball, gravity = BouncingBall(gravity=9.0), lambda ball: ball.gravity
        >>> fit = fit_free_fall(ball, gravity, times, height, 3e-4, state=start)
        >>> fit.estimates.round(2).tolist()  # gravity, height and velocity
        [9.82, 1.0, 0.0]
    """
    times, measured = np.asarray(times, dtype=float), np.asarray(measured, dtype=float)
    state = np.asarray(state, dtype=float)
    if times.shape != measured.shape or not np.all(np.diff(times) > 0):
        raise ValueError(
            "Give increasing `times` and one measured value for each time."
        )
    number = state.shape[0]
    starts, spans = jnp.asarray(times[:-1]), jnp.asarray(np.diff(times))

    def fall(model: FreeFall):
        def one(x, interval):
            t, span = interval
            end = flight_end(model.system, t, x, t + span, steps=steps)
            return end, end[observe]

        _, later = jax.lax.scan(one, model.state, (starts, spans))
        return jnp.append(model.state[observe], later)

    # the state is split into scalars, so that each can be a free parameter
    def pick(model):
        return [where(model.system), *model.state]

    split = FreeFall(system, tuple(jnp.asarray(v) for v in state))

    def joined(model):
        return fall(FreeFall(model.system, jnp.stack(model.state)))

    fit = fit_published(
        split,
        pick,
        [Published("free fall", joined, measured, error)],
        names=[name, *(f"state[{k}]" for k in range(number))],
        tolerances=[np.inf] * (number + 1),
    )
    found = FreeFall(fit.model.system, jnp.stack(fit.model.state))
    return dataclasses.replace(fit, model=found)
