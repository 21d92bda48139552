"""Find the first point of a branch by Newton's method, or along a tangent."""

import jax.numpy as jnp
import numpy as np

from ._context import Context
from ._point import with_field, with_parameter
from ._program import correct, Corrected, evaluate
from .problem import AbstractProblem


# maximum number of times that the step is shortened because the parameter turns back
_TURNED = 12
# below this, the sign of the parameter component of a unit tangent is unreliable
_SIDEWAYS = 1e-3


def solved_start(
    problem: AbstractProblem, context: Context, z: np.ndarray, name: str, direction: int
) -> Corrected:
    """Return the solution at the initial parameter, with its tangent in the requested
    direction.
    """
    across = np.zeros_like(z)
    across[-1] = 1.0
    at = correct(problem, context, z, across, across)
    if not at.success:
        # a larger number of iterations needs another program: compile it only if needed
        settings = with_field(context.settings, "max_iterations", 30)
        patient = context._replace(settings=settings)
        at = correct(problem, patient, z, across, across)
    if not at.success:
        # Newton's method fails if the derivative is singular, but the start itself may
        # be a solution
        given = evaluate(problem, context, z, across)
        size = np.abs(_residual(problem, z, context.leaf)) / given.scale[:-1]
        if not np.all(size <= context.settings.tolerance):
            raise ValueError(
                f"the start is not a solution at {name} = {z[-1]:g}, and "
                "Newton's method finds none near it; start from a better guess "
                f"(largest residual {_largest(size)})"
            )
        at = given
    return _oriented(problem, context, at, direction)


def leave(
    problem: AbstractProblem,
    context: Context,
    z: np.ndarray,
    tangent: np.ndarray,
    step: float,
) -> tuple[Corrected, float]:
    """Return the first point of a branch that leaves z along a tangent, and its
    distance from z, which is at most `step`.

    The step is shortened if the parameter turns back within it, because the values of
    the test functions at z, which would reveal the fold, are not known.
    """
    settings = context.settings
    zero = np.zeros_like(z)
    scale = evaluate(problem, context, z, zero + 1.0).scale
    tangent = np.asarray(tangent, float)
    tangent = tangent / np.linalg.norm(tangent / scale)
    low, high = context.bounds
    turned: list[tuple[Corrected, float]] = []
    while step >= settings.min_step and len(turned) < _TURNED:
        guess = z + step * tangent
        at = correct(problem, context, guess, tangent / scale**2, tangent)
        moved = np.linalg.norm((at.z - guess) / scale)
        if at.success and moved <= step and low <= at.z[-1] <= high:
            # the tangent here differs from that at z: orient it away from z
            outwards = evaluate(problem, context, at.z, at.z - z)
            if np.all(np.isfinite(outwards.tangent)):
                onwards = [at.z[-1] - z[-1]]
                if abs(tangent[-1]) > _SIDEWAYS * scale[-1]:
                    onwards.append(tangent[-1])
                if all(one * outwards.tangent[-1] >= 0 for one in onwards):
                    return outwards, step
                turned.append((outwards, step))
        step /= 2
    if turned:
        return turned[0]
    raise ValueError(
        "no branch leaves the start along the given tangent; start from a regular "
        "point, or use switch at a special point"
    )


def _oriented(
    problem: AbstractProblem, context: Context, at: Corrected, direction: int
) -> Corrected:
    """Return the same point with its tangent in the requested direction."""
    _, sizes, rows = np.linalg.svd(at.jacobian * at.scale[None, :])
    n = sizes.size
    null = rows[n:] if n == 0 else rows[np.append(sizes, 0) <= 1e-9 * sizes[0]]
    null = rows[-1:] if len(null) == 0 else null
    tangent = null.T @ null[:, -1]
    if np.linalg.norm(tangent) < 1e-9:
        tangent = null[-1] * (np.sign(null[-1].sum()) or 1.0)
    tangent = direction * tangent / np.linalg.norm(tangent)
    if len(null) == 1:
        return evaluate(problem, context, at.z, tangent * at.scale)
    at = with_field(at, "determinant", np.zeros(()))
    return with_field(at, "tangent", tangent * at.scale)


def _residual(problem: AbstractProblem, z: np.ndarray, leaf: int) -> np.ndarray:
    current = with_parameter(problem, leaf, z[-1])
    return np.asarray(current.residual(jnp.asarray(z[:-1]), current.parameters))


def _largest(size: np.ndarray) -> str:
    return f"{np.max(size):.1e}" if np.all(np.isfinite(size)) else "not finite"
