"""Sweep maps in the same way as sections of a flow."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...hybrid.codes import NOT_FINITE
from ...hybrid.programs import program
from ...parameters import pick
from ._samples import BEHIND, Samples
from ._section import AbstractSection


class Map(AbstractSection):
    """A map `function(state, parameters) -> state`; one period is one iteration.

    If a motion diverges, the points computed so far are kept, and its code is 3.

    Examples:
        >>> from jaxcam import sweeps
        >>> henon = lambda x, p: jnp.stack([p["a"] - x[0] ** 2 + p["b"] * x[1], x[0]])
        >>> section = sweeps.Map(henon, {"a": 1.4, "b": 0.3})
        >>> section.sample(np.zeros((1, 2)), turns=20, keep=5).states.shape
        (1, 5, 2)
    """

    function: Callable[[Float[Array, " n"], Any], Float[Array, " n"]] = eqx.field(
        static=True
    )
    """The map, written with `jax.numpy`, for a state of shape `(n,)`."""
    system: Any
    """Parameters of the map, any pytree of numbers."""
    t0: float
    """Index of the first iteration."""
    components: tuple[tuple[str, str], ...] = eqx.field(static=True)
    """Name and unit of each component of the state; default: x1, x2, ..."""
    regular: bool = eqx.field(static=True)
    """Samples are one iteration apart."""
    impacting: bool = eqx.field(static=True)
    """Impacts are not counted."""

    def __init__(
        self,
        function: Callable,
        system: Any = None,
        t0: float = 0.0,
        components: tuple[tuple[str, str], ...] = (),
    ):
        self.function, self.system, self.t0 = function, system, t0
        self.components = components
        self.regular, self.impacting = True, False

    def sample(self, states, turns, keep, *, where=None, values=None) -> Samples:
        states = np.asarray(states, dtype=float)
        where = None if where is None else pick(where, self.system)
        lanes = len(states)
        arrays = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), self.system)
        given = None if values is None else jnp.asarray(np.asarray(values, float))
        made = np.array(
            _iterate(self.function, arrays, where, given, states, turns, keep)
        )
        gone = ~np.all(np.isfinite(made[:, -1]), axis=1)
        code = np.where(gone, int(NOT_FINITE), 0)
        code[~np.all(np.isfinite(states), axis=1)] = BEHIND
        none = np.zeros((lanes, keep), dtype=int)
        times = self.t0 + np.arange(turns - keep + 1, turns + 1, dtype=float)
        return Samples(
            states=made,
            times=np.broadcast_to(times, (lanes, keep)),
            hits=none,
            rests=none,
            final=made[:, -1],
            contact=np.zeros(lanes, dtype=bool),
            code=code,
        )

    def starts(self, where=None, values=None) -> np.ndarray:
        raise ValueError("a map has no default start; pass the states to start from")

    def turn(self, where=None, values=None) -> np.ndarray:
        return np.ones(1)

    def lifted(self, states, where=None, values=None) -> np.ndarray:
        return np.asarray(states, dtype=float)

    def names(self, n: int) -> tuple[tuple[str, str], ...]:
        more = tuple((f"x{i + 1}", "-") for i in range(len(self.components), n))
        return self.components[:n] + more


@program
def _iterate(function, parameters, where, values, states, turns, keep):
    def one(value, state):
        own = parameters
        if where is not None:
            several = isinstance(where(parameters), tuple)
            own = eqx.tree_at(where, parameters, tuple(value) if several else value)

        def step(state, _):
            state = function(state, own)
            return state, state

        state, _ = jax.lax.scan(
            lambda s, _: (function(s, own), None), state, None, length=turns - keep
        )
        return jax.lax.scan(step, state, None, length=keep)[1]

    axes = (None if values is None else 0, 0)
    return jax.vmap(one, in_axes=axes)(values, jnp.asarray(states))
