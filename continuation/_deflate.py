"""Find additional solutions at one parameter value by deflation."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from jaxcam.hybrid.programs import program
from jaxcam.parameters import VectorLike

from ._parameter import as_arguments
from ._point import set_parameters
from ._program import newton, solve
from ._settings import BranchSettings
from .problem import AbstractProblem


@program
def _deflated(problem, guesses, known, count, scale, tolerance, iterations: int):
    """Apply Newton's method to G(u) prod_i (1/|u - u_i|^2 + 1), from all guesses at
    once.
    """

    def one(guess):
        def equations(y):
            g = problem.residual(y * scale, problem.parameters) / scale
            distance = jnp.mean((y[None, :] - known) ** 2, axis=1)
            there = jnp.arange(known.shape[0]) < count
            factor = jnp.prod(jnp.where(there, 1 / distance + 1, 1.0))
            return g * factor

        return newton(equations, guess / scale, tolerance, iterations)

    y, success, _ = jax.vmap(one)(guesses)
    return y * scale[None, :], success


def deflate(
    problem: AbstractProblem,
    guesses: ArrayLike | VectorLike | Sequence[VectorLike],
    known: Sequence[VectorLike] = (),
    *,
    settings: BranchSettings | None = None,
    most: int = 16,
    max_iterations: int = 100,
) -> tuple[np.ndarray, ...]:
    """Find solutions in addition to the known ones, at the parameters of the problem.

    Each solution found is divided out (Farrell, Birkisson and Funke, SIAM J. Sci.
    Comput. 37, 2015), so that Newton's method, starting from the same guesses,
    converges to another solution or not at all.

    Args:
        problem: The problem.
        guesses: Initial states for Newton's method, shape `(guesses, n)` or `(n,)`.
        known: States `(n,)` of known solutions.
        settings: Accuracy.
        most: Number of solutions, including the known ones, at which the search ends.
        max_iterations: Maximum number of Newton iterations per guess.

    Returns:
        The additional solutions, each of shape `(n,)`, in the order found.

    Raises:
        ValueError: A guess or a known solution has the wrong shape.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> others = continuation.deflate(problem, [[0.9]], [[1.0]])
        >>> [round(float(u[0]), 6) for u in others]
        [-1.0]
    """
    settings = BranchSettings() if settings is None else settings
    problem = set_parameters(problem, as_arguments(problem.parameters))
    starts = np.atleast_2d(np.asarray(guesses, float))
    if starts.ndim != 2 or not np.all(np.isfinite(starts)):
        raise ValueError("guesses must be finite numbers of shape (guesses, n)")
    n = starts.shape[1]
    solutions = [np.asarray(u, float).reshape(n) for u in known]
    if len(solutions) >= most:
        raise ValueError(f"{len(solutions)} solutions are known; give a larger `most`")
    size = np.maximum(1.0, np.sqrt(np.mean(starts**2)))
    scale = np.full(n, size)
    given = len(solutions)
    while len(solutions) < most:
        table = np.full((most, n), 1e3)
        for i, u in enumerate(solutions):
            table[i] = u / scale
        values, success = jax.device_get(
            _deflated(
                problem,
                # start next to each guess, which may itself be a known solution
                jnp.asarray(starts + 1e-6 * scale),
                jnp.asarray(table),
                jnp.asarray(len(solutions)),
                jnp.asarray(scale),
                jnp.asarray(settings.tolerance),
                max_iterations,
            )
        )
        fresh = [
            polished
            for value in values[success]
            for polished, converged, _ in [solve(problem, value, settings)]
            if converged
        ]
        before = len(solutions)
        for u in fresh:
            near = [np.max(np.abs(u - other) / scale) for other in solutions]
            if not near or min(near) > 1e-6:
                solutions.append(u)
            if len(solutions) == most:
                break
        if len(solutions) == before:
            break
    return tuple(solutions[given:])
