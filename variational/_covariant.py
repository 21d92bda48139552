"""Compute covariant Lyapunov vectors, the directions invariant under the linearised
flow.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import flow, HybridSystem, Settings
from jaxcam.hybrid.programs import program
from jaxcam.parameters import as_arrays

from ._turn_frames import orthonormal


class CovariantVectors(eqx.Module):
    """Covariant directions at the start of each period, in order of decreasing growth
    rate.

    One period maps `vectors[k, :, j]` to a multiple of `vectors[k + 1, :, j]`.
    """

    state: Float[Array, "turns n"]
    """State at the start of each period, shape `(turns, n)`."""
    vectors: Float[Array, "turns n n"]
    """Unit vectors, one per column, shape `(turns, n, n)`; NaN if the motion sticks at
    any time.
    """
    local: Float[Array, "turns n"]
    """Growth rate of each vector in each period (1/s), shape `(turns, n)`."""
    code: Array
    """0 if every period was completed, otherwise an index into `RESULTS`."""

    @property
    def exponents(self) -> Float[Array, " n"]:
        """The mean growth rates (1/s), which are the Lyapunov exponents, shape
        `(n,)`.
        """
        return self.local.mean(axis=0)

    @property
    def angle(self) -> Float[Array, " turns"]:
        """The smallest angle between two vectors (rad), shape `(turns,)`; 0 at a
        tangency.
        """
        size = jnp.abs(jnp.einsum("kij,kil->kjl", self.vectors, self.vectors))
        n = size.shape[-1]
        others = size * (1.0 - jnp.eye(n))[None]
        return jnp.arccos(jnp.minimum(jnp.max(others, axis=(1, 2)), 1.0))


def covariant_vectors(
    system: HybridSystem,
    state: Float[Array, " n"],
    turns: int = 200,
    *,
    t0: float = 0.0,
    transient: int = 100,
    settings: Settings | None = None,
) -> CovariantVectors:
    """Compute the covariant Lyapunov vectors along a motion, including impacts.

    Forwards in time, an orthonormal frame Q is propagated by the derivative M of the
    flow over each period to the next frame Q': M Q = Q' R, with R upper triangular.
    Backwards, vectors in this frame are propagated by the inverses of the matrices R,
    under which they converge to the covariant directions (Ginelli et al., Physical
    Review Letters 99, 130601, 2007). For a periodic orbit, these are the eigenvectors
    of the monodromy matrix. The function is pure: it can be compiled, and batched with
    `vmap` over states and parameters.

    Args:
        system: The system.
        state: State at `t0`, shape `(n,)`.
        turns: Number of periods returned. They are preceded by `transient` periods, in
            which transients decay and the frame converges, and followed by the same
            number, over which the vectors converge backwards in time.
        t0: Start time (s).
        transient: Number of periods before and after those returned.
        settings: Accuracy of the simulation; the default tolerance is 1e-12.

    Returns:
        A `CovariantVectors`. Sticking removes every perturbation, so a motion that
            sticks has no such directions, and all vectors are NaN.

    Raises:
        ValueError: The system has no period, or a number of periods is invalid.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import covariant_vectors
        >>> system = ImpactOscillator(omega=3.5, wall=-0.2, damping=0.02)
        >>> start = jnp.array([-0.9, 0.0])
        >>> covariant_vectors(system, start, turns=10, transient=10).vectors.shape
        (10, 2, 2)
    """
    if system.period is None:
        raise ValueError(
            "this system has no forcing period; give it a `period`, because covariant "
            "vectors are computed once per period"
        )
    if turns < 1 or transient < 1:
        raise ValueError(
            f"turns is {turns} and transient {transient}; give 1 or more of each"
        )
    system = as_arrays(system)
    settings = Settings(tolerance=1e-12) if settings is None else settings
    return _vectors(
        system,
        jnp.asarray(state, jnp.float64),
        jnp.asarray(t0, jnp.float64),
        as_arrays(settings),
        turns,
        transient,
    )


@program
def _vectors(system, state, t0, settings, turns: int, transient: int):
    n = state.shape[0]
    # all periods begin at the same phase of the forcing, so all are run from t0
    period: Any = system.period

    def turn(x):
        end = flow(system, x, t0, t0 + period, settings=settings)
        return end.state, (end.state, end.code)

    def forwards(carry, _):
        x, frame = carry
        matrix, (after, code) = jax.jacfwd(turn, has_aux=True)(x)
        moved = matrix @ frame
        new, _ = orthonormal(moved)
        return (after, new), (x, frame, new.T @ moved, code)

    def backwards(inner, triangle):
        # map vectors in the frame after a period to vectors in the frame before it
        solved = jax.scipy.linalg.solve_triangular(triangle, inner)
        growth = 1 / jnp.linalg.norm(solved, axis=0, keepdims=True)
        solved = solved * growth
        return solved, (solved, growth[0])

    count = transient + turns + transient
    start = (state, jnp.eye(n))
    _, (states, frames, triangles, codes) = jax.lax.scan(
        forwards, start, None, length=count
    )
    # ones above the diagonal, so that no vector lies in a smaller subspace
    upper = jnp.triu(jnp.ones((n, n)))
    upper = upper / jnp.linalg.norm(upper, axis=0, keepdims=True)
    _, (inner, growth) = jax.lax.scan(
        backwards, upper, jnp.triu(triangles), reverse=True
    )
    vectors = jnp.einsum("kij,kjl->kil", frames, inner)
    some = slice(transient, transient + turns)
    return CovariantVectors(
        states[some], vectors[some], jnp.log(growth[some]) / period, jnp.max(codes)
    )
