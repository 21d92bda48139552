"""Normal equations of the samples of a piece, by way of the nodes of its steps.

A sample is a function of the values and rates at both ends of its step and of the
calibration of its sensor. A step contains several samples: their information is summed
first, and multiplied by the derivatives of these quantities afterwards.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._predict import Calibration
from ._readings import Nodes


# Numbers of quantities on which a sample depends: those of its step and of its sensor
_OF_STEP, _OF_SENSOR = len(Nodes._fields), len(Calibration._fields)


def shares_of(
    sampled: Callable[[tuple[Nodes, Calibration]], Float[Array, "n m c"]],
    known: tuple[Nodes, Calibration],
) -> Float[Array, "q n m c"]:
    """Return the derivatives of each sample with respect to the quantities of its step
    and its sensor.

    Args:
        sampled: The samples of a piece as a function of these quantities.
        known: The quantities.

    Returns:
        The derivatives, in the order of the fields.
    """
    nodes, sensing = known

    def pushed(unit):
        moved = (
            Nodes(*(jnp.full_like(a, u) for a, u in zip(nodes, unit))),
            Calibration(
                *(jnp.full_like(a, u) for a, u in zip(sensing, unit[_OF_STEP:]))
            ),
        )
        return jax.jvp(sampled, (known,), (moved,))[1]

    return jax.vmap(pushed)(jnp.eye(_OF_STEP + _OF_SENSOR))


def normal_through(
    nodes: Nodes,
    sensing: Calibration,
    shares: Float[Array, "q n m c"],
    information: Float[Array, "n m c"],
    score: Float[Array, "n m c"],
) -> tuple[Float[Array, "a a"], Float[Array, " a"]]:
    """Return information and score of one piece.

    Args:
        nodes: Derivatives of the nodes with respect to the columns, each `(n, c, a)`.
        sensing: Derivatives of the calibration, each `(c, a)`.
        shares: Derivatives of each sample, from `shares_of`.
        information: Information of each sample.
        score: Score of each sample.

    Returns:
        Information and score of the columns.
    """
    inner = jnp.einsum("inmc,jnmc->ncij", shares * information[None], shares)
    pull = jnp.sum(shares * score[None], axis=2)[..., None]
    each = [*nodes, *(jnp.broadcast_to(a[None], nodes.left.shape) for a in sensing)]
    # written as sums: XLA multiplies many small matrices five times as slowly
    pushed = _summed(
        jnp.stack([_weighted(inner[:, :, i], each) for i in range(len(each))])
    )
    pulled = _summed(pull)
    rows = [_joined(nodes.left, nodes.right), _joined(*nodes[2:]), *sensing]
    flat = jnp.concatenate([one.reshape(-1, one.shape[-1]) for one in rows])
    return flat.T @ pushed, (flat.T @ pulled)[:, 0]


def _weighted(weights, parts):
    """Return the sum of `parts`, each `(n, c, a)`, with weights `(n, c, parts)`."""
    return sum(weights[:, :, j, None] * part for j, part in enumerate(parts))


def _joined(left, right):
    """Return the derivatives at the ends of all steps in a row, `(n + 1, c, a)`."""
    return jnp.concatenate([left, right[-1:]])


def _summed(parts):
    """Return the sums of the parts that share a node or a sensor, one row for each.

    **Arguments:** the parts `(q, n, c, a)` of each quantity of each step.
    """
    none = jnp.zeros_like(parts[0, :1])
    sums = [
        jnp.concatenate([parts[k], none]) + jnp.concatenate([none, parts[k + 1]])
        for k in (0, 2)
    ]
    sums += list(jnp.sum(parts[_OF_STEP:], axis=1))
    return jnp.concatenate([one.reshape(-1, one.shape[-1]) for one in sums])
