"""Find the stops of a system: constraints at a constant value of one coordinate."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..hybrid import HybridSystem
from ..parameters import pick


# number of states at which a gap is examined, and largest relative difference between
# two positions that are the same
_TRIES, _SAME = 6, 1e-9


def constant_stops(
    system: HybridSystem,
    parameter: str,
    values: Float[np.ndarray, " k"],
    size: int,
    component: int = 0,
) -> dict[str, float]:
    """Return the positions of the stops of a coordinate, by the name of the constraint,
    if they are the same at the smallest and the largest value of a parameter.

    A gap that depends on time, or on another coordinate, is not a stop.

    **Arguments:** `size`: number of components of the state.
    """
    picked = pick(parameter, system)
    low, high = (
        _places(picked.replaced(system, jnp.asarray(value)), size, component)
        for value in (np.min(values), np.max(values))
    )
    same = np.isclose(low, high, rtol=_SAME, atol=0.0)
    nameless = len(low) == 1 and not system.constraint_names
    return {
        "stop" if nameless else system.constraint_name(int(number)): float(low[number])
        for number in np.flatnonzero(same)
    }


def _places(
    system: HybridSystem, size: int, component: int
) -> Float[np.ndarray, " gaps"]:
    """Return the position of each stop, NaN for a gap that is none."""
    rng = np.random.default_rng(0)
    time, state = rng.uniform(0, 1, _TRIES), rng.uniform(-1, 1, (_TRIES, size))

    def gaps(t, x):
        return jnp.atleast_1d(system.gap(t, x))

    value = jax.vmap(gaps)(time, state)
    by_time, by_state = jax.vmap(jax.jacfwd(gaps, argnums=(0, 1)))(time, state)
    value, by_time, by_state = map(np.asarray, (value, by_time, by_state))
    own = by_state[..., component]
    others = np.delete(by_state, component, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        place = state[:, component, None] - value / own
    steady = np.all(by_time == 0, axis=0) & np.all(others == 0, axis=(0, 2))
    alone = np.all(own == own[0], axis=0) & np.all(own != 0, axis=0)
    return np.where(steady & alone, np.mean(place, axis=0), np.nan)
