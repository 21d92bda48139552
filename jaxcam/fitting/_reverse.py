"""Compute gradients in reverse mode, for systems with very many parameters."""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.optimize
from jax.flatten_util import ravel_pytree

from ..hybrid.programs import program
from ._fit import fit
from .engine import cost_of, Layout, Model, Point, Problem


def cost_and_gradient(
    problem: Problem, point: Point, where: Callable[[Model], Any], values: Any
) -> tuple[Any, Any]:
    """Return the cost of a problem and its gradient with respect to any part of the
    model.

    The computing time for a neural network with thousands of weights in the vector
    field is about the same as for one parameter. The states of the pieces are those of
    `point`. If they are fitted (`fit(problem, free=())`), they do not contribute to the
    gradient, so the result is the gradient of the cost minimised over the states.

    **Arguments:**

    - `where`: selects a field of the model, or a tuple of fields: `lambda m:
        m.system.network`.
    - `values`: values of the selected fields; their floating-point arrays are
        differentiated.

    **Returns:** the cost, and the gradient as a tree like `values`.
    """
    return _gradient(
        problem.layout, problem.pieces, problem.extras, point, where, values
    )


@program
def _gradient(layout, pieces, extras, point, where, values):
    # from here on, the parameter values are part of the model
    model = layout.at(point.values[0])
    bare = point._replace(values=point.values[:, :0])

    @eqx.filter_value_and_grad
    def cost(values):
        changed = eqx.tree_at(where, model, values)
        moved = Layout(changed, ())
        costs = cost_of(moved, pieces, extras, bare)
        parts = (
            jnp.sum(jnp.where(pieces.exists, costs.flown + costs.joints, 0.0)),
            jnp.sum(jnp.where(pieces.rest_exists, costs.rested, 0.0)),
        )
        return sum(parts)

    return cost(values)


class Trained(NamedTuple):
    """The result of `train`: the trained part, and the cost before and after."""

    values: Any
    """The trained field, or tuple of fields."""
    before: float
    """Cost before training."""
    after: float
    """Cost after training."""


def train(
    problem: Problem,
    where: Callable[[Model], Any],
    *,
    steps: int = 100,
    progress: Callable[[int, float], None] | None = None,
) -> Trained:
    """Fit a part of a model with very many parameters, such as a neural network.

    The method is L-BFGS (scipy) with reverse-mode gradients. At each step, the initial
    states of the pieces into which the recordings are divided (multiple shooting) are
    fitted first, so the gradient is that of the cost minimised over the states.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        problem: The problem.
        where: Selects a field of the model, or a tuple of fields: `lambda m:
            m.system.network`.
        steps: Maximum number of L-BFGS steps.
        progress: Called after each evaluation with its number and its cost.

    Returns:
        A `Trained`.

    Raises:
        ValueError: A parameter of the problem differs from recording to recording.

    Examples:
        >>> from jaxcam.fitting import train
        >>> wrong = fitting.Model(BouncingBall(gravity=9.5), sensors)
        >>> other = fitting.Problem.build(wrong, [parts], [])
        >>> trained = train(other, lambda m: m.system.gravity, steps=10)
        >>> round(float(trained.values), 2), trained.after < 0.1 * trained.before
        (9.81, True)
    """
    own = [p.name for p in problem.parameters if p.per_record or p.known is not None]
    if own:
        raise ValueError(
            f"`train` requires parameters shared by all recordings, but {own[0]!r} "
            "has a separate value in each; leave it out."
        )
    values = where(problem.model)
    arrays, rest = eqx.partition(values, eqx.is_inexact_array)
    start, unravel = ravel_pytree(arrays)
    point = problem.start
    costs: list[float] = []

    def evaluate(vector):
        nonlocal point
        part = eqx.combine(unravel(jnp.asarray(vector)), rest)
        changed = _with_part(problem, where, part)
        point = fit(changed, free=(), start=point).point
        cost, gradient = cost_and_gradient(problem, point, where, part)
        flat, _ = ravel_pytree(eqx.filter(gradient, eqx.is_inexact_array))
        costs.append(float(cost))
        if progress is not None:
            progress(len(costs), costs[-1])
        # per sample, so that the first step is not too long
        return costs[-1] / problem.samples, np.asarray(flat) / problem.samples

    found = scipy.optimize.minimize(
        evaluate,
        np.asarray(start),
        jac=True,
        method="L-BFGS-B",
        options={"maxiter": steps, "ftol": 1e-9, "gtol": 1e-7},
    )
    trained = eqx.combine(unravel(jnp.asarray(found.x)), rest)
    return Trained(trained, costs[0], float(found.fun) * problem.samples)


def _with_part(problem: Problem, where: Callable[[Model], Any], values: Any) -> Problem:
    """Return the problem with part of its model replaced."""
    model = eqx.tree_at(where, problem.model, values)
    layout = eqx.tree_at(lambda found: found.model, problem.layout, model)
    return dataclasses.replace(problem, model=model, layout=layout)
