"""Switch to other branches at a special point."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid.programs import program
from jaxcam.parameters import Where

from ._branch import branch
from ._context import Context
from ._parameter import pick_one, with_leaf
from ._point import Branch, Point
from ._program import evaluate
from ._settings import BranchSettings
from .algorithms import AbstractAlgorithm
from .problem import AbstractProblem, Start
from .special import BRANCH_POINT, FLIP, HOPF, second


def emanating(point: Point, where: Where, width: float = 1.0) -> tuple[Start, ...]:
    """Return the starts of the other branches that emanate from a special point.

    From a branch point, these are both halves of the other branch, whose direction
    solves the algebraic branching equation (thesis, eq. 3.37); from a flip, the
    period-doubled orbit; from a Hopf point of a [`continuation.Equilibrium`][], the
    limit cycle.

    **Arguments:** `width`: width of the parameter bounds, the unit in which changes of
    the parameter are measured.

    Raises:
        ValueError: No branch is known to emanate from the point.
    """
    problem = point.solved
    leaf, _ = pick_one(where, problem.parameters)
    context = Context(leaf, width, BranchSettings())
    if point.kind == BRANCH_POINT:
        direction = other_direction(problem, context, point)
        return tuple(
            Start(problem, point.state, point.parameter, sign * direction)
            for sign in (1.0, -1.0)
        )
    start = None
    if point.kind in (FLIP, HOPF):
        z = np.append(point.state, point.parameter)
        at = evaluate(problem, context, z, point.tangent)
        start = problem.transition(point, at)
    if start is None:
        raise ValueError(
            f"no branch is known to emanate from a {point.kind or 'regular'} point of "
            "this problem; branches emanate from branch points, flips and Hopf points"
        )
    return (start,)


def switch(
    point: Point,
    where: Where,
    bounds: tuple[float, float],
    algorithm: AbstractAlgorithm | None = None,
    *,
    settings: BranchSettings | None = None,
) -> tuple[Branch, ...]:
    """Follow all other branches that emanate from a special point.

    Args:
        point: A branch point, a flip or a Hopf point of a branch.
        where: Selects the parameter, as for [`continuation.follow`][].
        bounds: (lowest, highest) value of the parameter.
        algorithm: The algorithm; default: [`continuation.PseudoArclength`][].
        settings: Accuracy and step control.

    Returns:
        Two branches from a branch point, or one from a flip or a Hopf point. If the two
            branches meet again, they are one closed curve, traversed in both
            directions.

    Raises:
        ValueError: No branch is known to emanate from the point.

    Examples:
        >>> import continuation
        >>> f = lambda u, p: p["a"] * u * (1 - u)
        >>> logistic = continuation.FixedPoint(f, {"a": 2.0})
        >>> found = continuation.branch(logistic, [0.5], "a", (1.5, 3.3))
        >>> doubled = continuation.switch(found.of_kind("flip")[0], "a", (1.5, 3.3))
        >>> doubled[0].points[-1].stable
        True
    """
    starts = emanating(point, where, float(bounds[1] - bounds[0]))
    return tuple(
        branch(start.problem, start, where, bounds, algorithm, settings=settings)
        for start in starts
    )


@program
def _quadratic(problem: AbstractProblem, leaf: int, z, basis, left):
    """Return left . B(basis_i, basis_j), with B the second derivative of G(u, p)."""

    def g(z):
        return problem.residual(z[:-1], with_leaf(problem.parameters, leaf, z[-1]))

    def entry(a, b):
        return jnp.dot(left, second(g, z, a, b))

    return jax.vmap(lambda a: jax.vmap(lambda b: entry(a, b))(basis))(basis)


def other_direction(
    problem: AbstractProblem, context: Context, point: Point
) -> np.ndarray:
    """Return the direction (n+1,) of the branch that crosses at a simple branch point
    (thesis, eq. 3.37).
    """
    z = np.append(point.state, point.parameter)
    at = evaluate(problem, context, z, point.tangent)
    left, _, rows = np.linalg.svd(at.jacobian * at.scale[None, :])
    basis = rows[-2:]
    form = np.asarray(
        _quadratic(
            problem, context.leaf, jnp.asarray(z), jnp.asarray(basis * at.scale),
            jnp.asarray(left[:, -1]),
        )
    )  # fmt: skip
    # an indefinite quadratic form in two variables vanishes on two lines
    sizes, axes = np.linalg.eigh((form + form.T) / 2)
    if not sizes[0] < 0 < sizes[1]:
        raise ValueError(
            f"the algebraic branching equation at {point.parameter:g} has no second "
            "real root: the point is isolated, or of higher order"
        )
    one, two = np.sqrt(sizes[1]), np.sqrt(-sizes[0])
    lines = [
        (one * axes[:, 0] + sign * two * axes[:, 1]) @ basis for sign in (1.0, -1.0)
    ]
    known = point.tangent / at.scale
    known = known / np.linalg.norm(known)
    other = min(lines, key=lambda v: abs(v @ known) / np.linalg.norm(v))
    return other / np.linalg.norm(other) * at.scale
