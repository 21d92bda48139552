"""Derivatives of an impacting orbit: over a period, and of its equations at a flip."""

from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid._normal import gaps
from variational import saltation_matrix

from ._shooting_flight import flight_end


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


def monodromy(problem: "ImpactingOrbits", u, parameters) -> Float[Array, "n n"]:
    """Derivative of the state one period after the first impact by that there."""
    starts, ends = problem.segments(u, parameters)

    def saltation_after_flight(start, end, which):
        def fly(x):
            y = flight_end(parameters, start[0], x, end[0], steps=problem.steps)
            return y, y

        flown, before = jax.jacfwd(fly, has_aux=True)(start[1:])
        return saltation_matrix(parameters, end[0], before, which) @ flown

    matrix = jnp.eye(problem.dimension)
    for factor in jax.vmap(saltation_after_flight)(starts, ends, problem.hit()):
        matrix = factor @ matrix
    return matrix


def return_map(
    problem: "ImpactingOrbits", u, parameters, matrix
) -> Float[Array, "k k"]:
    """Derivative of the return map to the first constraint, from the monodromy matrix.

    In coordinates on the surface, k = n - 1.
    """
    starts, _ = problem.segments(u, parameters)
    t, x = starts[0, 0], starts[0, 1:]
    which = problem.constraints[0]
    normal = jax.grad(lambda y: gaps(parameters, t, y)[which])(x)
    along = parameters.vector_field(t, x)
    along = along / jnp.dot(normal, along)
    basis = jnp.linalg.qr(normal[:, None], mode="complete")[0][:, 1:]
    moved = matrix @ basis
    return basis.T @ (moved - along[:, None] * (normal @ moved)[None, :])


@eqx.filter_jit
def antiperiodic(problem: "ImpactingOrbits", u, parameters) -> Float[Array, "u u"]:
    """Derivative of the equations for a deviation that changes sign each period.

    It is singular at a flip, where its null vector is the deviation of the doubled
    orbit. The first column belongs to the first phase, also without forcing.
    """
    if not problem.constraints:
        jacobian = problem.jacobian(u, parameters)
        whole = problem.linearisation(u, parameters, jacobian)
        return whole + jnp.eye(problem.dimension)
    starts, ends = problem.segments(u, parameters)
    unit = problem.period(u, parameters) / max(problem.periods, 1)
    scale = jnp.ones(1 + problem.dimension).at[0].set(unit)[None, :]

    def along(flat):
        rows = flat.reshape(starts.shape) * scale
        return jax.jvp(
            lambda a, b: problem.defects(parameters, a, b),
            (starts, ends),
            (rows, problem.next_rows(rows, last=-1.0)),
        )[1]

    return jax.jacfwd(along)(jnp.zeros_like(u))
