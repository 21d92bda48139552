"""Special points as differentiable functions of all other parameters."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxcam.hybrid.programs import program
from jaxcam.parameters import Where
from variational.orbits import implicit_root

from ._curve import extended
from ._parameter import as_arguments, leaf_of, with_leaf
from ._point import Point


def special_point(
    point: Point, where: Where, parameters: PyTree
) -> tuple[Float[Array, " n"], Float[Array, ""]]:
    """Locate a special point for other values of the parameters, also under `jit` and
    `jvp`.

    Newton's method is applied to the extended system, starting at `point`; the
    derivative follows from the implicit function theorem. The parameters must be close
    enough to those of `point` for Newton's method to converge.

    Args:
        point: A fold, flip, Neimark-Sacker or Hopf point, or a zero of a monitor.
        where: Selects the parameter in which the point is located.
        parameters: Parameters with the same structure as those of the problem; the
            selected one is ignored.

    Returns:
        The state `(n,)` and the value of the selected parameter; NaN if Newton's method
            fails.

    Examples:
        >>> import continuation
        >>> field = lambda u, p: p["a"] - p["shift"] - u**2
        >>> problem = continuation.Equilibrium(field, {"a": 1.0, "shift": 0.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> fold = found.special[0]
        >>> _, value = continuation.special_point(fold, "a", {"a": 1.0, "shift": 0.1})
        >>> round(float(value), 6)
        0.1
    """
    value = point.parameter
    problem = extended(point, where, (value - 0.5, value + 0.5))
    u = jnp.append(jnp.asarray(point.state), leaf_of(problem.parameters, problem.leaf))
    parameters = as_arguments(parameters, problem.leaf)
    scale = problem.scale(u, problem.parameters)

    def equations(y):
        return problem.residual(y * scale, parameters) / scale

    found = implicit_root(equations, u / scale) * scale
    return found[:-1], found[-1]


@program
def _derivatives(problem, u, moving, fixed):
    """Return the derivative of the last unknown, which is the selected parameter, with
    respect to each leaf of `moving`.
    """

    def residual(u, moving):
        return problem.residual(u, eqx.combine(moving, fixed))

    inverse = jnp.linalg.inv(jax.jacfwd(residual)(u, moving))
    by_leaf = jax.jacfwd(residual, argnums=1)(u, moving)
    return jax.tree.map(lambda d: -jnp.tensordot(inverse[-1], d, 1), by_leaf)


def sensitivity(point: Point, where: Where) -> PyTree:
    """Return the derivatives of a special point's parameter value with respect to all
    other parameters.

    An example is d(speed at the flip) / d(restitution). The derivatives follow from the
    implicit function theorem for the extended system.

    Args:
        point: As for [`continuation.special_point`][].
        where: As for [`continuation.special_point`][].

    Returns:
        A tree like the parameters of the problem, in which each float leaf is replaced
            by the derivative with respect to it. The derivative is 0 for the selected
            parameter and None for leaves that are not floats.

    Examples:
        >>> import continuation
        >>> field = lambda u, p: p["a"] - p["shift"] - u**2
        >>> problem = continuation.Equilibrium(field, {"a": 1.0, "shift": 0.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> fold = found.special[0]
        >>> round(float(continuation.sensitivity(fold, "a")["shift"]), 6)
        1.0
    """
    value = point.parameter
    problem = extended(point, where, (value - 0.5, value + 0.5))
    parameters = as_arguments(problem.parameters, problem.leaf)
    u = np.append(point.state, leaf_of(parameters, problem.leaf))
    moving, fixed = eqx.partition(parameters, eqx.is_inexact_array)
    found = jax.device_get(_derivatives(problem, jnp.asarray(u), moving, fixed))
    return with_leaf(found, _position(moving, parameters, problem.leaf), 0.0)


def _position(moving: PyTree, parameters: PyTree, leaf: int) -> int:
    """Return the index of leaf number `leaf` among the float leaves only."""
    del moving
    leaves = jax.tree.leaves(parameters)[:leaf]
    return sum(eqx.is_inexact_array(x) for x in leaves)
