"""Correct points of a branch and evaluate them, with one compiled program for each
problem structure.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Float

from jaxcam.hybrid.newton import newton_at_once, newton_on_host
from jaxcam.hybrid.programs import program

from ._context import Context
from ._evaluation import AbstractAtOnce, Evaluation
from ._padding import Padded
from ._parameter import with_leaf
from .problem import AbstractProblem


class Corrected(eqx.Module):
    """A point on the branch and its derivatives.

    Arrays are traced inside programs and NumPy arrays outside.
    """

    z: Float[Any, " n1"]
    success: Any
    iterations: Any
    jacobian: Float[Any, "n n1"]
    """Derivative of the residual with respect to (state, parameter), shape (n, n+1)."""
    linearisation: Float[Any, "k k"]
    tangent: Float[Any, " n1"]
    determinant: Any
    """The (n+1)-th root of the modulus of the determinant of the scaled Jacobian,
    bordered by the tangent, with the sign of that determinant.
    """
    scale: Float[Any, " n1"]
    monitors: dict[str, Any]
    observed: dict[str, Any]


def residual_at(problem: AbstractProblem, leaf: int, z):
    """Return the residual G at z = (u, parameter)."""
    parameters = with_leaf(problem.parameters, leaf, z[-1])
    return problem.residual(z[:-1], parameters)


def scale_at(problem: AbstractProblem, leaf: int, z, width):
    """Return scales (n+1,) such that the norm of dz / scale is the length of a step
    dz.
    """
    parameters = with_leaf(problem.parameters, leaf, z[-1])
    u = z[:-1]
    number = jnp.asarray(problem.number_of_unknowns(u), u.dtype)
    size = problem.scale(u, parameters) * jnp.sqrt(number)
    return jnp.concatenate([size, jnp.reshape(width, (1,))])


def newton(function, y, tolerance, max_iterations: int):
    """Return a root of `function`, whether Newton's method converged, and the number of
    iterations. With fewer equations than unknowns, each correction has the least norm
    (Moore-Penrose).
    """
    solution = optx.root_find(
        lambda y, _: function(y),
        optx.Newton(rtol=tolerance, atol=tolerance),
        y,
        max_steps=max_iterations,
        throw=False,
    )
    value = solution.value
    success = (solution.result == optx.RESULTS.successful) & jnp.all(
        jnp.isfinite(value)
    )
    return value, success, solution.stats["num_steps"]


def tangent_and_determinant(jacobian, scale, old):
    """Return the tangent in the direction of `old`, of unit length when scaled (thesis,
    eq. 3.33), and the root of the determinant described in `Corrected`.
    """
    scaled = jacobian * scale[None, :]
    old = old / scale
    last = jnp.zeros_like(old).at[-1].set(1.0)
    raw = jnp.linalg.solve(jnp.concatenate([scaled, old[None, :]]), last)
    tangent = raw / jnp.linalg.norm(raw)
    sign, log = jnp.linalg.slogdet(jnp.concatenate([scaled, tangent[None, :]]))
    return tangent * scale, sign * jnp.exp(log / scale.size)


def correct_(
    problem: AbstractProblem,
    leaf: int,
    guess,
    normal,
    old,
    width,
    tolerance,
    max_iterations: int,
    least_norm: bool,
    given: Any = False,
) -> Corrected:
    """Correct `guess` and evaluate all quantities at the point found.

    If the guess is `given` as a solution, the quantities are evaluated at the guess
    itself.

    `normal` (n+1,) is the covector of the plane through the guess in which the solution
    is searched for; it is ignored with `least_norm` (Moore-Penrose). `old` gives the
    direction of the tangent. The function is not compiled by itself, so that it can be
    batched.
    """
    scale = scale_at(problem, leaf, guess, width)
    if isinstance(problem, AbstractAtOnce):
        parts = scale, normal, old, width, tolerance, max_iterations, least_norm
        return _at_once(problem, leaf, guess, given, *parts)

    def equations(y):
        g = residual_at(problem, leaf, y * scale) / scale[:-1]
        if least_norm:
            return g
        plane = jnp.dot(normal * scale, y - guess / scale)
        return jnp.concatenate([g, plane[None]])

    y, success, iterations = newton(equations, guess / scale, tolerance, max_iterations)
    z = jnp.where(given, guess, y * scale)
    iterations = jnp.where(given, 0, iterations)
    return _seen(problem, leaf, z, old, width, success | given, iterations)


def _at_once(
    problem, leaf, guess, given, scale, normal, old, width, tolerance, iterations,
    least_norm,
) -> Corrected:  # fmt: skip
    """Return the same as `correct_` for a problem that is evaluated at once."""

    def at(p):
        return with_leaf(problem.parameters, leaf, p)

    def evaluate(y):
        # without rounding, if the guess is the solution
        z = jnp.where(given, guess, y * scale)
        return problem.evaluated(z[:-1], z[-1], at)

    def equations(y, found):
        return _augmented(y, guess, scale, normal, found, least_norm)

    start = guess / scale
    solved = newton_at_once(evaluate, equations, start, tolerance, iterations, given)
    z = jnp.where(given, guess, solved.y * scale)
    success, found = solved.success | given, solved.found
    return _corrected(problem, leaf, z, old, width, success, solved.iterations, found)


def _augmented(y, guess, scale, normal, found: Evaluation, least_norm: bool, xp=jnp):
    """Return the scaled equations and their Jacobian; unless `least_norm`, the last
    equation is that of the plane through the guess.
    """
    value = found.residual / scale[:-1]
    matrix = found.jacobian * scale[None, :] / scale[:-1, None]
    if least_norm:
        return value, matrix
    plane = xp.dot(normal * scale, y - guess / scale)
    row = (normal * scale)[None]
    return xp.append(value, plane), xp.concatenate([matrix, row])


def _seen(problem, leaf, z, old, width, success, iterations) -> Corrected:
    """Evaluate all quantities at a point that is already a solution."""
    u, p = z[:-1], z[-1]
    parameters = with_leaf(problem.parameters, leaf, p)
    jacobian, linearisation = problem.derivatives(
        u, p, lambda p: with_leaf(problem.parameters, leaf, p)
    )
    monitors, observed = problem.seen(u, parameters)
    found = Evaluation(None, jacobian, linearisation, monitors, observed)
    return _corrected(problem, leaf, z, old, width, success, iterations, found)


def _corrected(
    problem, leaf, z, old, width, success, iterations, found: Evaluation
) -> Corrected:
    scale = scale_at(problem, leaf, z, width)
    jacobian = found.jacobian
    tangent, determinant = tangent_and_determinant(jacobian, scale, old)
    return Corrected(
        z=z,
        success=jnp.asarray(success) & jnp.all(jnp.isfinite(jacobian)),
        iterations=jnp.asarray(iterations),
        jacobian=jacobian,
        linearisation=found.linearisation,
        tangent=tangent,
        determinant=determinant,
        scale=scale,
        monitors=found.monitors,
        observed=found.observed,
    )


_correct = program(correct_)


def _plain(at: Corrected) -> Corrected:
    """Return the same point with NumPy arrays, which are faster on the host."""
    return Corrected(
        **{
            f.name: jax.tree.map(np.asarray, getattr(at, f.name))
            for f in dataclasses.fields(at)
        }
    )


def correct(
    problem, context: Context, guess, normal, old, least_norm=False, given=False
):
    """Return the result of the compiled `correct_` as NumPy arrays. Numbers that may
    change between calls are passed as arrays, so that they are not compiled in.
    """
    padded = problem.padded()
    vectors = [np.asarray(z) for z in (guess, normal, old)]
    if isinstance(problem, AbstractAtOnce) and padded is None:
        direction = {"normal": vectors[1], "old": vectors[2]}
        at = _on_host(problem, context, vectors[0], least_norm, given, **direction)
        if at is not None:
            return at
    if padded is not None:
        vectors = [padded.widened(z) for z in vectors]
    at = _plain(
        _correct(
            problem if padded is None else padded.problem,
            context.leaf,
            *vectors,
            np.asarray(context.width),
            np.asarray(context.settings.tolerance),
            context.settings.max_iterations,
            least_norm,
            np.asarray(given),
        )
    )
    return at if padded is None else _narrowed(at, padded, problem)


_scales, _complete = program(scale_at), program(_corrected)


def _on_host(
    problem: AbstractAtOnce, context: Context, guess, least_norm, given, *, normal, old
) -> Corrected | None:
    """Return the result of `correct` for a problem that is evaluated outside of traced
    programs; None if it cannot be.
    """
    leaf, settings = context.leaf, context.settings
    first = problem.evaluated_on_host(leaf, guess)
    if first is None:
        return None
    width = np.asarray(context.width)
    scale = np.asarray(_scales(problem, leaf, guess, width))

    def equations(y, found):
        return _augmented(y, guess, scale, normal, found, least_norm, np)

    solved = newton_on_host(
        lambda y: problem.evaluated_on_host(leaf, y * scale),
        equations,
        guess / scale,
        settings.tolerance,
        settings.max_iterations,
        bool(given),
        first,
    )
    z = guess if given else solved.y * scale
    success, count = np.asarray(solved.success or given), np.asarray(solved.iterations)
    return _plain(_complete(problem, leaf, z, old, width, success, count, solved.found))


def _narrowed(at: Corrected, padded: Padded, problem: AbstractProblem) -> Corrected:
    """Return the results for the original unknowns of a padded problem."""
    kept = padded.positions(padded.kept.size + 1)
    # the additional equations u = 0 multiply the determinant by the scales of u
    added = np.delete(at.scale, kept)
    root = np.abs(at.determinant)
    with np.errstate(divide="ignore"):
        log = at.scale.size * np.log(root) - np.sum(np.log(added))
    determinant = np.sign(at.determinant) * np.exp(log / kept.size)
    return dataclasses.replace(
        at,
        z=at.z[kept],
        jacobian=at.jacobian[np.ix_(padded.kept, kept)],
        tangent=at.tangent[kept],
        determinant=determinant,
        scale=at.scale[kept],
        monitors={name: at.monitors[name] for name in problem.monitors()},
        observed={
            name: value[: padded.lengths[name]] if name in padded.lengths else value
            for name, value in at.observed.items()
        },
    )


def evaluate(problem, context: Context, z, old) -> Any:
    """Evaluate all quantities at a point that is already a solution.

    This uses the program of `correct`, because its iterations take less time than
    compiling another program.
    """
    return correct(problem, context, z, old, old, given=True)


@program
def _solve(problem, u, tolerance, max_iterations: int):
    scale = problem.scale(u, problem.parameters)

    def equations(y):
        g = problem.residual(y * scale, problem.parameters)
        # there are as many equations as unknowns: each equation is divided by the scale
        # of an unknown, so that the tolerance is relative to these scales
        return g / scale

    y, success, iterations = newton(equations, u / scale, tolerance, max_iterations)
    g = problem.residual(y * scale, problem.parameters)
    return y * scale, success & jnp.all(jnp.isfinite(g)), iterations, g


def solve(problem, u, settings, iterations: int = 30):
    """Solve a problem at its own parameters, starting from a guess; return the
    solution, whether Newton's method converged, and the residual.
    """
    padded, u = problem.padded(), np.asarray(u)
    if padded is not None:
        problem, u = padded.problem, padded.widened(u)
    value, success, _, g = _solve(
        problem, u, np.asarray(settings.tolerance), iterations
    )
    value, g = np.asarray(value), np.asarray(g)
    if padded is not None:
        kept = padded.positions(padded.kept.size)
        value, g = value[kept], g[kept]
    return value, bool(success), g
