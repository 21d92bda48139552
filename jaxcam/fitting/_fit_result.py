"""What a fit found: estimates, their covariance, and how it ended."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from ._columns import invert, prior_information, reduced
from ._ellipse import Ellipse, ellipse_of, most_correlated
from ._linearise import Costs, Point
from ._model import Model
from ._problem import Problem


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A fitted number and its standard error; of a record where each has its own."""

    name: str
    value: float
    stderr: float
    unit: str = ""
    record: str | None = None

    @property
    def label(self) -> str:
        """The name, with `@record` where each record has its own."""
        return self.name if self.record is None else f"{self.name}@{self.record}"

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of a Gaussian with this standard error."""
        return self.value - 1.96 * self.stderr, self.value + 1.96 * self.stderr


@dataclasses.dataclass(frozen=True)
class Fit:
    """What a fit found.

    - `problem`, `point`: parameters and states at the optimum.
    - `free`: names of the parameters that were free.
    - `estimates`: one for each free number, in the order of `covariance`.
    - `covariance`: from the Fisher information, what was known beforehand included.
    - `cost`: minus twice the log-likelihood (less a constant) with the prior; `costs`:
        of each piece, without it.
    - `converged`, `iterations`, `message`: how it ended.
    """

    problem: Problem
    point: Point
    free: tuple[str, ...]
    estimates: tuple[Estimate, ...]
    covariance: Float[np.ndarray, "g g"]
    cost: float
    costs: Costs
    converged: bool
    iterations: int
    message: str

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter, by name or `name@record`.

        **Raises:** `KeyError` that lists the names there are.
        """
        for one in self.estimates:
            if name in (one.name, one.label):
                return one
        known = ", ".join(one.name for one in self.estimates)
        raise KeyError(f"{name!r} was not fitted; the fitted parameters are {known}")

    @property
    def correlation(self) -> Float[np.ndarray, "g g"]:
        """Correlations of the estimates."""
        size = np.sqrt(np.diag(self.covariance))
        size = np.where(size > 0, size, 1.0)
        return self.covariance / np.outer(size, size)

    def ellipse(self, names: Sequence[str], level: float = 0.95) -> Ellipse:
        """Joint confidence region of two or more parameters, the others left free.

        **Arguments:** names as in `estimates`, with `@record` where each record has its
        own; the probability that the region holds the truth.

        **Raises:** `KeyError` for a name that was not fitted; `ValueError` for a level
        outside 0 and 1, fewer than two names, or an error that is not finite.
        """
        labels = [one.label for one in self.estimates]
        values = [one.value for one in self.estimates]
        return ellipse_of(names, labels, values, self.covariance, level)

    def most_correlated(self) -> str:
        """The pair of parameters that is told apart worst, in a sentence."""
        return most_correlated([e.label for e in self.estimates], self.correlation)

    def model(self, record: int | str = 0) -> Model:
        """The model with the parameters that were found; of one record where some
        parameters differ from record to record."""
        names = self.problem.records
        row = names.index(record) if isinstance(record, str) else record
        return self.problem.layout.at(self.point.values[row])

    def to_json(self) -> dict[str, Any]:
        """Plain numbers and strings."""
        return {
            "parameters": [dataclasses.asdict(one) for one in self.estimates],
            "correlation": self.correlation.tolist(),
            "cost": self.cost,
            "samples": self.problem.samples,
            "records": list(self.problem.records),
            "converged": self.converged,
            "iterations": self.iterations,
            "message": self.message,
        }


def finish(
    problem, columns, point, blocks, costs, cost, prior, converged, count, message
):
    """Standard errors, and everything in one place."""
    information, _ = reduced(columns, blocks)
    information = information + np.diag(prior_information(problem, columns, prior))
    covariance = invert(information) * np.outer(columns.scale, columns.scale)
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
        converged,
        count,
        message,
    )
