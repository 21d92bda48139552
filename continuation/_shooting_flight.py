"""One free flight of known length, compiled lean, with a derivative that is cheap.

The event loop finds out when a flight ends; here its duration is an unknown of the
equations, so that a fixed number of Runge-Kutta steps suffices and the end depends
smoothly on everything, also where the flight grazes or passes through a constraint.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid._runge_kutta import tableau_of


_TABLEAU = tableau_of(diffrax.Dopri8())
_STAGES = len(_TABLEAU.nodes)
_LOWER = np.zeros((_STAGES, _STAGES))
for _i, _row in enumerate(_TABLEAU.lower):
    _LOWER[_i + 1, : len(_row)] = _row


def flight_nodes(
    system: HybridSystem, t0, x0: Float[Array, " n"], t1, steps: int
) -> tuple[Float[Array, " steps"], Float[Array, "steps n"], Float[Array, ""]]:
    """Free flight from `x0` at `t0` to `t1` (s) in equal steps of order eight.

    **Returns:** the times and states at the ends of the steps, and the sum of the
    error estimates, relative to 1 + |x|.
    """
    prepared = system.prepared()
    lower, nodes = jnp.asarray(_LOWER), jnp.asarray(_TABLEAU.nodes)
    weights, wrong = jnp.asarray(_TABLEAU.weights), jnp.asarray(_TABLEAU.error)
    h = (t1 - t0) / steps
    empty = jnp.zeros((_STAGES, x0.shape[0]))

    def one(carry, k):
        x, error = carry
        t = t0 + k * h

        # a loop over the stages: unrolled it runs as fast and compiles ten times longer
        def stage(rates, i):
            rate = prepared.vector_field(
                t + nodes[i] * h, x + h * _combined(lower[i], rates)
            )
            return rates.at[i].set(rate), None

        rates, _ = jax.lax.scan(stage, empty, jnp.arange(_STAGES))
        after = x + h * _combined(weights, rates)
        part = jnp.max(jnp.abs(h * _combined(wrong, rates)) / (1.0 + jnp.abs(after)))
        return (after, error + part), after

    count = jnp.arange(steps, dtype=jnp.float64)
    (_, error), states = jax.lax.scan(one, (x0, jnp.zeros_like(t1)), count)
    return t0 + (count + 1) * h, states, error


def _combined(weights, rates):
    """Weighted sum of the stages; with derivatives a product of matrices is slower."""
    return jnp.sum(weights[:, None] * rates, axis=0)


@eqx.filter_custom_jvp
def flight_end(system: HybridSystem, t0, x0, t1, *, steps: int) -> Float[Array, " n"]:
    """State at `t1` (s) after free flight from `x0` at `t0`.

    Its forward derivative is one small Jacobian a flight, whatever the number of
    directions asked for, so that the matrix of a long orbit costs as much as its
    flights and not as their square. Can be differentiated again.
    """
    return _end(system, t0, x0, t1, steps)


@flight_end.def_jvp
def _flight_end_jvp(primals, tangents, *, steps):
    leaves, treedef = jax.tree.flatten(primals)
    dots = jax.tree.leaves(tangents, is_leaf=lambda x: x is None)
    moving = [i for i, dot in enumerate(dots) if dot is not None]
    shapes = [jnp.shape(leaves[i]) for i in moving]
    local = jnp.concatenate([jnp.ravel(leaves[i]) for i in moving])
    direction = jnp.concatenate([jnp.ravel(dots[i]) for i in moving])

    def moved(vector):
        new, used = list(leaves), 0
        for i, shape in zip(moving, shapes, strict=True):
            size = int(np.prod(shape))
            new[i] = vector[used : used + size].reshape(shape)
            used += size
        system, t0, x0, t1 = jax.tree.unflatten(treedef, new)
        end = _end(system, t0, x0, t1, steps)
        return end, end

    by_each, end = jax.jacfwd(moved, has_aux=True)(local)
    return end, by_each @ direction


def _end(system, t0, x0, t1, steps):
    return flight_nodes(system, t0, x0, t1, steps)[1][-1]
