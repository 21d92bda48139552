"""One flight (or one stretch of contact) together with its deviations."""

from collections.abc import Callable
from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


# of the end state and of the entries of the matrix, relative and absolute
TOLERANCE = 1e-14


class Flight(NamedTuple):
    """The end of a flight and how it depends on its start."""

    #: (n,) state at the end
    state: Float[Array, " n"]
    #: (n, n + q): by the state at the start, then by the q parameters
    matrix: Float[Array, "n columns"]
    #: logarithm of the determinant of the first n columns (Liouville)
    log_volume: Float[Array, ""]


def fly(field: Callable, parameters: Float[Array, " q"], t0, x, t1) -> Flight:
    """Integrate the motion and its variational equations from `t0` to `t1`.

    **Arguments:** `field(parameters, t, x)`, smooth on the way: no event is looked for.
    """
    n, q = x.shape[0], parameters.shape[0]
    length = t1 - t0

    def rates(share, y, args):
        del args
        state, matrix, _ = y
        t = t0 + share * length
        rate = field(parameters, t, state)
        by_state = jax.jacfwd(lambda s: field(parameters, t, s))(state)
        forced = jnp.zeros((n, n + q))
        if q:
            by_parameter = jax.jacfwd(lambda p: field(p, t, state))(parameters)
            forced = forced.at[:, n:].set(by_parameter)
        return (
            length * rate,
            length * (by_state @ matrix + forced),
            length * jnp.trace(by_state),
        )

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        diffrax.Dopri8(scan_kind="lax"),
        0.0,
        1.0,
        None,
        (x, jnp.eye(n, n + q), jnp.zeros(())),
        stepsize_controller=diffrax.PIDController(rtol=TOLERANCE, atol=TOLERANCE),
        adjoint=diffrax.ForwardMode(),
        throw=False,
        max_steps=4096,
    )
    assert solution.ys is not None
    done = solution.result == diffrax.RESULTS.successful
    ends = jax.tree.map(lambda a: jnp.where(done, a[0], jnp.nan), solution.ys)
    return Flight(*ends)
