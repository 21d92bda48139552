"""Compute the rates of change of gaps from measured velocities."""

from collections.abc import Collection

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..hybrid.programs import program
from .engine import DriveState, Layout


def gap_rates(
    layout: Layout,
    values: Float[np.ndarray, " p"],
    columns: tuple,
    looks: tuple,
    measured: Collection[int],
) -> list[Float[np.ndarray, " k"] | None]:
    """Return the rate of change of each gap at every sample, `(k,)`, or `None` if it
    depends on a state component that no channel measures.

    **Arguments:** the model and the values of its parameters; time, states and drive at
    every sample and at a few of them; the components that are measured.
    """
    slopes = np.max(np.abs(np.asarray(_slopes(layout, values, *looks))), axis=0)
    unseen = [k for k in range(slopes.shape[-1]) if k not in measured]
    # a NaN is no rate, either
    shown = np.all(slopes[:, unseen] == 0, axis=-1) & np.any(slopes > 0, axis=-1)
    if not np.any(shown):
        return [None] * len(slopes)
    rates = np.asarray(_rates(layout, values, *columns)).T
    return [rate if one else None for rate, one in zip(rates, shown)]


@program
def _rates(layout: Layout, values, times, states, *drive):
    return jax.vmap(lambda *at: _rates_at(layout, values, *at))(
        *(jnp.asarray(x) for x in (times, states, *drive))
    )


@program
def _slopes(layout: Layout, values, times, states, *drive):
    """Return the derivatives of the rates with respect to the state."""

    def one(time, state, *drive):
        return jax.jacfwd(lambda x: _rates_at(layout, values, time, x, *drive))(state)

    return jax.vmap(one)(*(jnp.asarray(x) for x in (times, states, *drive)))


def _rates_at(layout: Layout, values, time, state, *drive):
    system = layout.at(jnp.asarray(values)).driven(time, DriveState(*drive))
    tangent = jnp.ones_like(time), system.vector_field(time, state)
    gap = jax.jvp(lambda t, x: system.gap(t, x), (time, state), tangent)[1]
    return jnp.atleast_1d(gap)
