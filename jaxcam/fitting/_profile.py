"""Compute profile likelihoods: the cost of the best fit with some parameters fixed."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from ._fit import fit
from ._fit_result import Fit
from .engine import nominal_of, Weights


@dataclasses.dataclass(frozen=True)
class Profile:
    """The profile likelihood of one parameter.

    The cost is below 3.84, the 95 % quantile of the chi-square distribution with one
    degree of freedom, inside the 95 % interval; `interval` is interpolated, and
    infinite on a side where the cost does not reach this value.
    """

    name: str
    """Name of the parameter."""
    values: Float[np.ndarray, " k"]
    """Values at which the parameter was fixed, shape `(k,)`."""
    cost: Float[np.ndarray, " k"]
    """Minus twice the log-likelihood, relative to the optimum, shape `(k,)`."""
    fits: tuple[Fit, ...]
    """The fits with the parameter fixed at each of `values`."""

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval."""
        best = int(np.argmin(self.cost))
        return (
            self._crossing(range(best, -1, -1), -np.inf),
            self._crossing(range(best, len(self.cost)), np.inf),
        )

    def _crossing(self, order, none: float) -> float:
        order = list(order)
        for a, b in zip(order, order[1:]):
            # the square root of the cost is more nearly linear than the cost
            low, high = (np.sqrt(max(self.cost[k], 0.0)) for k in (a, b))
            level = np.sqrt(3.84)
            if low <= level < high:
                share = (level - low) / (high - low)
                return float(self.values[a] + share * (self.values[b] - self.values[a]))
        return none


def profile(
    found: Fit,
    name: str,
    *,
    reach: float = 3.0,
    points: int = 9,
    values: Sequence[float] | None = None,
    weights: Weights | None = None,
    prior: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Profile:
    """Compute a profile likelihood: fix one parameter at several values and fit all
    others.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        found: The fit, in which `name` was free.
        name: Name of the parameter.
        reach: Range of values on either side of the optimum, in standard errors.
        points: Number of values, including the optimum.
        values: Values at which to fix the parameter, in any order, instead of those
            that `reach` and `points` define; a value is inside the 95 % interval if its
            cost is below 3.84.
        weights: Weight of each piece of the data; use the same value as for `found`.
        prior: Whether tolerances count as prior knowledge; use the same value as for
            `found`.
        progress: Called with the number of completed values and the total number.

    Returns:
        A `Profile`.

    Raises:
        KeyError: The parameter was not fitted.
        ValueError: The parameter differs from recording to recording; or its standard
            error is not finite, and `values` is not given.

    Examples:
        >>> from jaxcam.fitting import profile
        >>> profile(found, "gravity", points=3).cost.shape
        (3,)
    """
    _require_shared(found, name)
    estimate = found[name]
    problem, others = found.problem, [n for n in found.free if n != name]
    parameter = problem.parameter(name)
    if values is None:
        if not np.isfinite(estimate.stderr):
            raise ValueError(
                f"The standard error of {name!r} is {estimate.stderr}, so it gives no "
                "range to profile; give the `values` at which to fix the parameter."
            )
        offsets = np.linspace(-reach, reach, points | 1)
        tried = estimate.value + offsets * estimate.stderr
    else:
        tried = np.sort(np.asarray(values, dtype=float))
    tried = np.clip(tried, parameter.lower, parameter.upper)
    place = problem.names.index(name)
    fits: dict[int, Fit] = {}
    middle = int(np.searchsorted(tried, estimate.value))
    # outwards from the optimum, each fit starting from its neighbour
    for side in (range(middle, len(tried)), range(middle - 1, -1, -1)):
        near = found
        for k in side:
            start = near.point._replace(
                values=near.point.values.at[:, place].set(tried[k])
            )
            near = fit(problem, free=others, start=start, weights=weights, prior=prior)
            fits[k] = near
            if progress is not None:
                progress(len(fits), len(tried))
    # prior knowledge of the fixed parameter counts as well
    cost = np.array([fits[k].cost for k in range(len(tried))])
    if prior:
        cost = cost + _known(problem, name, tried)
    return Profile(
        name,
        tried,
        cost - min(np.min(cost), found.cost),
        tuple(fits[k] for k in range(len(tried))),
    )


def excess_cost(
    found: Fit,
    values: Mapping[str, float],
    *,
    weights: Weights | None = None,
    prior: bool = True,
) -> float:
    """Return the cost, relative to the optimum, with several parameters fixed and all
    others fitted.

    This cost defines the joint confidence region of d parameters of a nonlinear model:
    values are inside if their cost is below the quantile of the chi-square distribution
    with d degrees of freedom, `found.ellipse(names).limit`. The example continues the
    one in [`jaxcam.fitting.fit`][].

    Args:
        found: The fit, in which all parameters in `values` were free.
        values: Values by name.
        weights: Weight of each piece of the data; use the same value as for `found`.
        prior: Whether tolerances count as prior knowledge; use the same value as for
            `found`.

    Returns:
        The cost.

    Raises:
        KeyError: A parameter was not fitted.
        ValueError: A parameter differs from recording to recording.

    Examples:
        >>> from jaxcam.fitting import excess_cost
        >>> excess_cost(found, {"gravity": found.estimates[0].value}) < 1e-3
        True
    """
    problem, cost = found.problem, 0.0
    point = found.point
    for name, value in values.items():
        _require_shared(found, name)
        place = problem.names.index(name)
        point = point._replace(values=point.values.at[:, place].set(value))
        cost += float(_known(problem, name, value)) if prior else 0.0
    others = [n for n in found.free if n not in values]
    held = fit(problem, free=others, start=point, weights=weights, prior=prior)
    return held.cost + cost - found.cost


def _require_shared(found: Fit, name: str) -> None:
    if found[name].record is not None:
        raise ValueError(
            f"{name!r} has a value for each recording; profile a parameter that all "
            "recordings share."
        )


def _known(problem, name: str, values):
    """Return the contribution of the prior to the cost, at given values."""
    parameter = problem.parameter(name)
    nominal = nominal_of(problem, problem.names.index(name))
    return ((values - nominal) / parameter.prior_stderr) ** 2
