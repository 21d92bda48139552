"""The result of a fit: estimates, their covariance, and how it ended."""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from ..tables import counted, ShortTable
from ._doubts import (
    Doubt,
    not_finite,
    on_a_bound,
    poor_fit,
    Reason,
    too_many_events,
    unexplained_switches,
)
from ._ellipse import Ellipse, ellipse_of, most_correlated
from ._unconstrained import Unconstrained, unconstrained
from .engine import (
    Costs,
    held_firmer,
    invert_information,
    Model,
    Point,
    prior_information,
    Problem,
    reduced,
    Weights,
)


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A fitted number and its standard error, for all recordings or for one of them.

    The standard error is infinite if the data do not constrain the value; the fit then
    reports this and does not count as converged.
    """

    name: str
    """Name of the parameter."""
    value: float
    """Estimate."""
    stderr: float
    """Standard error."""
    unit: str = ""
    """Unit."""
    record: str | None = None
    """Name of the recording if each has its own value, otherwise `None`."""

    @property
    def label(self) -> str:
        """The name, with `@record` if each recording has its own value."""
        return self.name if self.record is None else f"{self.name}@{self.record}"

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of a Gaussian distribution with this standard error."""
        return self.value - 1.96 * self.stderr, self.value + 1.96 * self.stderr


@dataclasses.dataclass(frozen=True, repr=False)
class Fit:
    """The result of a fit.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Examples:
        >>> found.converged, found.free
        (True, ('gravity',))
    """

    problem: Problem
    """The fitted problem."""
    point: Point
    """Parameters and states at the optimum."""
    free: tuple[str, ...]
    """Names of the parameters that were free."""
    estimates: tuple[Estimate, ...]
    """One estimate for each free value, in the order of `covariance`."""
    covariance: Float[np.ndarray, "g g"]
    """Covariance from the Fisher information, including prior knowledge."""
    cost: float
    """Minus twice the log-likelihood (up to a constant), including the prior."""
    costs: Costs
    """Cost of each piece, without the prior."""
    optimal: bool
    """Whether the iteration met its tolerance at an optimum."""
    iterations: int
    """Number of iterations."""
    ended: str
    """The reason the iteration ended, in words."""
    weights: Weights | None = None
    """Weight of each piece of the data; `None` if all have the same weight."""
    unconstrained: tuple[Unconstrained, ...] = ()
    """Combinations of parameters that the data do not constrain."""

    def __repr__(self) -> str:
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> ShortTable:
        """Return a table of the outcome and the estimates."""
        runs = counted(len(self.problem.records), "recording")
        count = f"{self.problem.samples} samples, {runs}"
        trusted = "converged" if self.converged else "not trustworthy"
        rows = [
            (one.label, f"{one.value:.7g}", f"{one.stderr:.2g}", one.unit)
            for one in self.estimates
        ]
        headings = ("parameter", "value", "standard error", "unit")
        sentence = f"Fit to {count}, {trusted}. {self.message}"
        return ShortTable(sentence, headings, rows, ("parameter", "unit"))

    @functools.cached_property
    def reasons(self) -> tuple[Reason, ...]:
        """The reasons not to trust the fit; empty if it has converged.

        They are computed from the fit itself, so they are always consistent with it.
        """
        found = []
        if not self.optimal:
            found.append(Reason(Doubt.NO_OPTIMUM, self.ended))
        wrong = not_finite(self.problem, self.point, self.cost, self.costs)
        if wrong:
            found.append(Reason(Doubt.NOT_FINITE, wrong))
        else:
            far = poor_fit(self.problem, self.costs, self.weights)
            found += [Reason(Doubt.POOR_FIT, far)] if far else []
            many = too_many_events(self.problem, self.point, self.weights)
            found += [Reason(Doubt.TOO_MANY_EVENTS, many)] if many else []
            jumps = unexplained_switches(self.problem, self.point, self.weights)
            found += [Reason(Doubt.UNEXPLAINED_SWITCH, jumps)] if jumps else []
        bounds = on_a_bound(self.problem, self.free, self.point)
        found += [Reason(Doubt.ON_A_BOUND, one) for one in bounds]
        found += [
            Reason(Doubt.NOT_CONSTRAINED, one.sentence()) for one in self.unconstrained
        ]
        named = {name for one in self.unconstrained for name in one.names}
        found += [
            Reason(Doubt.NOT_FINITE, f"The error of {one.label} is {one.stderr}.")
            for one in self.estimates
            if not np.isfinite(one.stderr) and one.label not in named
        ]
        return tuple(found)

    @property
    def converged(self) -> bool:
        """Return whether the fit is at an optimum with residuals that the noise
        explains.

        If true, all standard errors are finite; if false, `reasons` lists what is
        wrong.
        """
        return not self.reasons

    @property
    def message(self) -> str:
        """Describe how the fit ended, with every reason for doubt."""
        return " ".join(one.sentence for one in self.reasons) or self.ended

    def __getitem__(self, name: str) -> Estimate:
        """Return the estimate of a parameter, by name or `name@record`.

        Raises:
            KeyError: The name is unknown; the message lists the names.
        """
        for one in self.estimates:
            if name in (one.name, one.label):
                return one
        known = ", ".join(one.name for one in self.estimates)
        raise KeyError(f"{name!r} was not fitted; the fitted parameters are {known}")

    @property
    def correlation(self) -> Float[np.ndarray, "g g"]:
        """Correlations of the estimates; zero if the data do not constrain a value."""
        size = np.sqrt(np.diag(self.covariance))
        size = np.where(size > 0, size, 1.0)
        found = np.where(np.isinf(self.covariance), 0.0, self.covariance)
        found = found / np.outer(size, size)
        np.fill_diagonal(found, 1.0)
        return found

    def ellipse(self, names: Sequence[str], level: float = 0.95) -> Ellipse:
        """Return the joint confidence region of two or more parameters, with all others
        free.

        Args:
            names: Names as in `estimates`, with `@record` if each recording has its own
                value.
            level: Probability that the region contains the true values.

        Returns:
            An `Ellipse`.

        Raises:
            KeyError: A name was not fitted.
            ValueError: The level is not between 0 and 1, there are fewer than two
                names, or an error is not finite.
        """
        labels = [one.label for one in self.estimates]
        values = [one.value for one in self.estimates]
        return ellipse_of(names, labels, values, self.covariance, level)

    def most_correlated(self) -> str:
        """Return a sentence about the most correlated pair of parameters."""
        return most_correlated([e.label for e in self.estimates], self.correlation)

    def model(self, record: int | str = 0) -> Model:
        """Return the model with the fitted parameters.

        A parameter that differs between recordings has its value for `record`.

        The example continues the one in [`jaxcam.fitting.fit`][].

        Examples:
            >>> float(found.model().system.gravity) == found.estimates[0].value
            True
        """
        names = self.problem.records
        row = names.index(record) if isinstance(record, str) else record
        return self.problem.layout.at(self.point.values[row])

    def to_json(self) -> dict[str, Any]:
        """Return the fit as plain numbers and strings."""
        return {
            "parameters": [dataclasses.asdict(one) for one in self.estimates],
            "correlation": self.correlation.tolist(),
            "cost": self.cost,
            "samples": self.problem.samples,
            "records": list(self.problem.records),
            "converged": self.converged,
            "reasons": [
                {"doubt": one.doubt.name.lower(), "sentence": one.sentence}
                for one in self.reasons
            ],
            "iterations": self.iterations,
            "message": self.message,
        }


def finish(
    problem,
    columns,
    point,
    blocks,
    costs,
    cost,
    optimal,
    count,
    ended,
    *,
    prior,
    weights=None,
):
    """Return the `Fit` at the end of an iteration, with standard errors."""
    information, _ = reduced(columns, blocks)
    known = np.diag(prior_information(problem, columns, prior))
    information = information + known
    size = len(columns.scale)
    labels = columns.labels(problem)
    blind: tuple[Unconstrained, ...] = ()
    covariance = np.full((size, size), np.nan)
    if np.all(np.isfinite(information)):
        covariance = invert_information(information) * np.outer(
            columns.scale, columns.scale
        )
        blind = unconstrained(
            labels,
            information,
            columns.scale,
            lambda: held_firmer(columns, blocks) + known,
        )
        # an unconstrained parameter has no finite error
        unknown = {name for one in blind for name in one.names}
        rows = [k for k, label in enumerate(labels) if label in unknown]
        covariance[rows, :] = 0.0
        covariance[:, rows] = 0.0
        covariance[rows, rows] = np.inf
    stderr = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    values = np.asarray(point.values)
    estimates = []
    for g, (p, r) in enumerate(zip(columns.parameter, columns.record)):
        parameter = problem.parameters[p]
        record = problem.records[r] if r >= 0 else None
        value = float(values[max(r, 0), p])
        estimates.append(
            Estimate(parameter.name, value, float(stderr[g]), parameter.unit, record)
        )
    names = tuple(dict.fromkeys(problem.names[p] for p in columns.parameter))
    costs = jax.device_get(costs)
    return Fit(
        problem,
        point,
        names,
        tuple(estimates),
        covariance,
        float(cost),
        costs,
        optimal,
        count,
        ended,
        weights,
        blind,
    )
