"""Fit parameters to published values instead of recordings.

The data are published values (multipliers, positions, speeds, bifurcation points). The
model is a differentiable function that computes them, and nominal values with
tolerances are the prior:

    minimise  sum ((f_i(p) - y_i) / e_i)^2  +  sum ((p_j - n_j) / s_j)^2.
"""

import functools
import itertools
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ...hybrid.programs import program
from ...parameters import VectorLike
from ._published_fit import PublishedFit


# residual (in standard errors) that is used if a quantity cannot be computed
_HOPELESS = 1e8
# relative change below which the iteration ends
_XTOL = 1e-10


class Published(eqx.Module):
    """Published values, and the function that computes them from the model.

    Raises:
        ValueError: An error is not positive.

    Examples:
        >>> from jaxcam.fitting import Published
        >>> fall = lambda ball: jnp.sqrt(2 / ball.gravity)[None]
        >>> Published("fall from 1 m", fall, [0.45152], [1e-5]).values.tolist()
        [0.45152]
    """

    name: str = eqx.field(static=True)
    """Name of the values for the report."""
    compute: Callable[[Any], Float[Array, " k"]]
    """Function of the model that returns an array `(k,)`; it must be
    differentiable, as [`variational.impact_orbit`][] and
    [`variational.fold_of_orbit`][] are.
    """
    values: Float[np.ndarray, " k"]
    """The values as printed, shape `(k,)`."""
    errors: Float[np.ndarray, " k"]
    """Standard errors, a number or an array `(k,)`. A number printed to m decimal
    places has a standard error of 10^-m / sqrt(12) from rounding alone; see
    [`jaxcam.fitting.published.rounding_error`][].
    """

    def __init__(self, name: str, compute, values, errors):
        self.name = name
        self.compute = compute
        self.values = np.atleast_1d(np.asarray(values, dtype=float))
        self.errors = np.broadcast_to(
            np.asarray(errors, dtype=float), self.values.shape
        )
        if not np.all(self.errors > 0):
            raise ValueError(
                f"Give {name!r} positive standard errors; a printed number has at "
                "least the error of rounding."
            )


def rounding_error(decimals: int) -> float:
    """Return the standard deviation of the error of rounding to `decimals` decimal
    places.

    Args:
        decimals: Number of digits after the decimal point.

    Returns:
        10^-decimals / sqrt(12).

    Examples:
        >>> from jaxcam.fitting.published import rounding_error
        >>> drawn = np.random.default_rng(0).uniform(0.0, 1.0, 100000)
        >>> round(rounding_error(2), 5), round(float(np.std(drawn.round(2) - drawn)), 5)
        (0.00289, 0.00288)
    """
    return 10.0**-decimals / 12**0.5


def fit_published(
    model: eqx.Module,
    where: Callable[[Any], Sequence[Any]],
    published: Sequence[Published],
    *,
    names: Sequence[str],
    tolerances: VectorLike,
    start: VectorLike | None = None,
    max_steps: int = 512,
    progress: Callable[[int, float], None] | None = None,
) -> PublishedFit:
    """Fit parameters of a model to published values.

    The method is Levenberg-Marquardt, in stages of decreasing standard errors.

    Args:
        model: A system, or a module that contains one, at the nominal values.
        where: Selects the free scalars; the priors are centred on the nominal values.
        published: The data.
        names: Names of the free parameters.
        tolerances: Standard deviations of the priors; infinity for none.
        start: Initial values; default: the nominal values.
        max_steps: Maximum number of evaluations in each stage.
        progress: Called after each evaluation with its number and the cost.

    Returns:
        A [`jaxcam.fitting.published.PublishedFit`][].

    Raises:
        ValueError: The lengths of arguments differ, or a number is invalid.

    Examples:
        >>> from jaxcam import fitting, models
        >>> ball, free = models.BouncingBall(), lambda ball: (ball.gravity,)
        >>> fall = lambda ball: jnp.sqrt(2 / ball.gravity)[None]  # from 1 m (s)
        >>> data = [fitting.Published("fall", fall, [0.45152], [1e-5])]
        >>> fit = fitting.fit_published(ball, free, data, names=["g"], tolerances=[1.0])
        >>> round(float(fit.estimates[0]), 2)
        9.81
    """
    nominal, unravel = _picked(model, where)
    priors = np.asarray(tolerances, dtype=float)
    _check_lengths(nominal.shape[0], names, priors)
    # scale of a parameter without a prior: its own size
    own = np.where(np.asarray(nominal) == 0, 1.0, np.abs(np.asarray(nominal)))
    scales = np.where(np.isfinite(priors), priors, own)
    weights = np.isfinite(priors).astype(float)
    values = np.concatenate([p.values for p in published])
    errors = np.concatenate([p.errors for p in published])
    quantities = tuple(p.compute for p in published)

    def predicted(unknowns, model):
        moved = eqx.tree_at(
            where, model, unravel(nominal + jnp.asarray(scales) * unknowns)
        )
        return jnp.concatenate([jnp.atleast_1d(f(moved)) for f in quantities])

    @program
    def linearised(unknowns, model):
        # a single call site, because tracing and compiling the quantities takes most of
        # the time
        def twice(unknowns):
            value = predicted(unknowns, model)
            return value, value

        jacobian, value = jax.jacfwd(twice, has_aux=True)(unknowns)
        return value, jacobian

    def cost(unknowns, value):
        misses = np.append((value - values) / errors, weights * unknowns)
        return float(np.sum(misses**2))

    describe = _described(lambda at: linearised(at, model), cost, progress)
    unknowns = np.zeros(nominal.shape[0])
    if start is not None:
        unknowns = (np.asarray(start, dtype=float) - np.asarray(nominal)) / scales
    before, _ = describe(unknowns)
    _refuse_lost(published, before)
    furthest = float(np.max(np.abs((before - values) / errors)))
    stages = max(0, int(np.ceil(np.log10(max(furthest, 1.0)))) - 1)
    steps, converged = 0, False
    for power in range(stages, -1, -1):
        soft = errors * 10.0**power
        solution = _least_squares(describe, values, soft, weights, unknowns, max_steps)
        unknowns, converged = solution.x, bool(solution.success)
        steps += int(solution.nfev)
    after, jacobian = describe(unknowns)
    found = nominal + jnp.asarray(scales * unknowns)
    return PublishedFit.build(
        model=eqx.tree_at(where, model, unravel(found)),
        names=tuple(names),
        nominal=np.asarray(nominal),
        tolerances=priors,
        estimates=np.asarray(found),
        jacobian=jacobian / errors[:, None] / scales,
        published=tuple(published),
        predicted=after,
        steps=steps,
        converged=converged,
    )


def _check_lengths(number: int, names, priors) -> None:
    for given, length in (("names", len(names)), ("tolerances", len(priors))):
        if length != number:
            raise ValueError(
                f"`where` selects {number} numbers, but there are {length} `{given}`; "
                "give one for each."
            )
    if not np.all(priors > 0):
        raise ValueError(
            "Give positive `tolerances`; omit known parameters from `where`."
        )


def _refuse_lost(published, values) -> None:
    """Raise `ValueError` if a quantity cannot be computed."""
    lost = [
        p.name
        for p, part in zip(published, _split(published, values), strict=True)
        if not np.all(np.isfinite(part))
    ]
    if lost:
        raise ValueError(
            f"{', '.join(lost)} cannot be computed at the start; start nearer to the "
            "solution."
        )


def _least_squares(describe, values, errors, weights, unknowns, max_steps):
    """Return the optimum for these errors; `describe` returns the quantities and their
    derivatives.
    """

    def residuals(unknowns):
        misses = (describe(unknowns)[0] - values) / errors
        misses = np.where(np.isfinite(misses), misses, _HOPELESS)
        return np.concatenate([misses, weights * unknowns])

    def slopes(unknowns):
        slope = describe(unknowns)[1] / errors[:, None]
        return np.concatenate([np.nan_to_num(slope), np.diag(weights)])

    # optimistix finds the same optimum, but does not scale parameters by their
    # derivatives and compiles the quantities into its loop: for the thesis rig, it
    # needs 1.7 times the steps and twice the time
    return scipy.optimize.least_squares(
        residuals,
        unknowns,
        slopes,  # pyright: ignore
        method="lm",
        xtol=_XTOL,
        ftol=_XTOL,
        gtol=_XTOL,
        max_nfev=max_steps,
    )


def _described(program, cost, progress):
    """Return a function that evaluates the quantities and their derivatives and caches
    its last result.
    """
    counted = itertools.count(1)

    @functools.lru_cache(maxsize=1)
    def cached(content):
        unknowns = np.frombuffer(content)
        value, slope = jax.device_get(program(jnp.asarray(unknowns)))
        if progress is not None:
            progress(next(counted), cost(unknowns, value))
        return value, slope

    # the optimizer requests value and derivative at the same point, one after the other
    return lambda unknowns: cached(np.asarray(unknowns, dtype=float).tobytes())


def _split(published, vector):
    lengths = np.cumsum([p.values.size for p in published])[:-1]
    return np.split(vector, lengths)


def _picked(model, where):
    leaves = [jnp.asarray(leaf, dtype=float) for leaf in where(model)]
    if any(leaf.ndim != 0 for leaf in leaves):
        raise ValueError("`where` must select single numbers; index any arrays in it.")
    flat, unravel = ravel_pytree(leaves)
    like = where(model)

    def rebuilt(vector):
        return type(like)(unravel(vector))

    return flat, rebuilt
