"""Levenberg-Marquardt on the parameters of a `Problem`, its states eliminated."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ._eliminate import eliminate, step_of
from ._linearise import assemble, Blocks, Costs, Point
from ._model import Model
from ._parameter import Parameter
from ._problem import Problem, Weights
from ._sharpness import loosened, width_of


_ITERATIONS = 60
# A step that promises less than this (twice the log-likelihood) is the last
_PROMISE = 1e-3
# Steps that may follow before the first one is judged
_CORRECTIONS = 3
# A flight of more pieces than this is not foretold from its start at once
_LONG = 16
# in units of the parameters' scales, over which a model may bend
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1.0, 1e-6, 1e12


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A fitted number and its standard error; of a record where each has its own."""

    name: str
    value: float
    stderr: float
    unit: str = ""
    record: str | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of a Gaussian with this standard error."""
        return self.value - 1.96 * self.stderr, self.value + 1.96 * self.stderr


@dataclasses.dataclass(frozen=True)
class Columns:
    """The free numbers: which parameter each is, and of which record (-1: of all).

    `local` `(r, m)`: which parameter each column of a record's equations is;
    `place` `(r, m)`: where it is among the free numbers, -1 where it fills up.
    """

    parameter: Int[np.ndarray, " g"]
    record: Int[np.ndarray, " g"]
    local: Int[np.ndarray, "r m"]
    place: Int[np.ndarray, "r m"]
    scale: Float[np.ndarray, " g"]

    @property
    def scales(self) -> Float[np.ndarray, "r m"]:
        padded = np.append(self.scale, 0.0)
        return padded[self.place]


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
            if name in (one.name, f"{one.name}@{one.record}"):
                return one
        known = ", ".join(one.name for one in self.estimates)
        raise KeyError(f"{name!r} was not fitted; the fitted parameters are {known}")

    @property
    def correlation(self) -> Float[np.ndarray, "g g"]:
        """Correlations of the estimates."""
        size = np.sqrt(np.diag(self.covariance))
        size = np.where(size > 0, size, 1.0)
        return self.covariance / np.outer(size, size)

    @property
    def data_cost(self) -> float:
        """Minus twice the log-likelihood of samples and joints, all with weight one."""
        return float(sum(np.sum(np.asarray(part)) for part in self._counted()))

    def _counted(self):
        exists = np.asarray(self.problem.pieces.exists)
        rests = np.asarray(self.problem.pieces.rest_exists)
        return (
            np.where(exists, self.costs.flown, 0.0),
            np.where(exists, self.costs.joints, 0.0),
            np.where(rests, self.costs.rested, 0.0),
        )

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


def fit(
    problem: Problem,
    *,
    free: Iterable[str] | None = None,
    start: Fit | Point | Mapping[str, float] | None = None,
    weights: Weights | None = None,
    prior: bool = True,
    iterations: int = _ITERATIONS,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Fit the free parameters of a problem.

    **Arguments:**

    - `free`: names of the parameters to fit; by default all of them. The others stay
        at the values of `start`.
    - `start`: another fit, or values of some parameters; by default the nominal ones.
    - `weights`: how much each piece of the data counts.
    - `prior`: whether the tolerances count as knowledge; bounds always hold.
    - `progress`: called with the number of the iteration and the cost.

    **Raises:** `ValueError` for a name that is not a parameter.
    """
    columns = free_columns(problem, free)
    point = start_point(problem, start)
    point = _inside(problem, columns, point)
    extras = problem.weighted(weights)
    if problem.longest_flight > _LONG and point.states is problem.start.states:
        loose = loosened(extras)
        most = max(iterations, _ITERATIONS)
        point = _descend(problem, columns, loose, point, prior, most, None)[0]
    found = _descend(problem, columns, extras, point, prior, iterations, progress)
    point, blocks, costs, cost, converged, count, message = found
    return finish(
        problem, columns, point, blocks, costs, cost, prior, converged, count, message
    )


def _descend(problem, columns, extras, point, prior, iterations, progress):
    """Damped scoring from a point to an optimum near it."""
    local, scales = jnp.asarray(columns.local), jnp.asarray(columns.scales)

    def linearise(point):
        return assemble(problem.layout, problem.pieces, extras, point, local, scales)

    def total(costs, point):
        return _total(costs, extras) + prior_cost(problem, columns, point, prior)

    blocks, costs = linearise(point)
    cost = total(costs, point)
    damping, message, converged, count = _FIRST_DAMPING, "", False, 0
    while count < iterations:
        count += 1
        step, promise = _step(problem, columns, blocks, point, damping, prior)
        fine = np.isfinite(promise)
        if fine and promise < _PROMISE and damping <= 1e-1:
            converged, message = True, "The optimum was reached."
            break
        found, changed, value = blocks, costs, np.inf
        if fine:
            found, changed = linearise(step)
            value = total(changed, step)
        for _ in range(_CORRECTIONS):
            # the valley is curved and steep: a long step along it ends on its side, and
            # is judged by where the next ones lead
            if value <= cost or not np.isfinite(value):
                break
            step, _ = _step(problem, columns, found, step, damping, prior)
            found, changed = linearise(step)
            value = total(changed, step)
        if value <= cost and np.isfinite(value):
            gained = (cost - value) / max(promise, 1e-300)
            point, blocks, costs, cost = step, found, changed, value
            damping = max(damping * (0.1 if gained > 0.5 else 0.5), _LEAST_DAMPING)
            if progress is not None:
                progress(count, cost)
        else:
            damping *= 10
            if damping > _MOST_DAMPING:
                message = (
                    "No step improves the fit any more although it is not at an "
                    "optimum; look at the residuals, or start elsewhere."
                )
                break
    else:
        message = (
            f"The optimum was not reached in {iterations} iterations; allow more of "
            f"them, or start closer."
        )
    return point, blocks, costs, cost, converged, count, message


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


def held_out_cost(problem: Problem, found: Fit, weights: Weights) -> float:
    """Cost of data under a fit that need not have seen them.

    The parameters stay as they are; the states of the pieces are fitted to the data, as
    nobody can predict them. Joints between pieces that count are included.
    """
    other = fit(problem, free=(), start=found, weights=weights, prior=False)
    return other.cost


def free_columns(problem: Problem, free: Iterable[str] | None) -> Columns:
    """Which numbers are free. **Raises:** `ValueError` for an unknown name."""
    wanted = problem.names if free is None else tuple(free)
    for name in wanted:
        problem.parameter(name)
    records = len(problem.segments)
    picked = [k for k, p in enumerate(problem.parameters) if p.name in wanted]
    parameter, record, scale = [], [], []
    # as wide for any choice of them, which is one program then
    place = -np.ones((records, width_of(len(problem.names))), dtype=int)
    local = np.zeros_like(place)
    for column, k in enumerate(picked):
        one = problem.parameters[k]
        size = one.size(_nominal(problem, k))
        local[:, column] = k
        for r in range(records if one.per_record else 1):
            parameter.append(k)
            record.append(r if one.per_record else -1)
            scale.append(size)
            rows = r if one.per_record else slice(None)
            place[rows, column] = len(parameter) - 1
    return Columns(
        np.array(parameter, dtype=int),
        np.array(record, dtype=int),
        local,
        place,
        np.array(scale, dtype=float),
    )


def start_point(problem: Problem, start) -> Point:
    """Where to begin."""
    if isinstance(start, Fit):
        return start.point
    if isinstance(start, Point):
        return start
    values = np.array(problem.start.values)
    for name, value in (start or {}).items():
        problem.parameter(name)
        values[:, problem.names.index(name)] = value
    return problem.start._replace(values=jnp.asarray(values))


def reduced(columns: Columns, blocks: Blocks):
    """Information and score of the free numbers, in units of their scales."""
    return _gathered(columns, eliminate(blocks))


def _gathered(columns: Columns, found):
    """Sums over the records, each number in its place."""
    size = len(columns.scale)
    information, score = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
    for r, place in enumerate(columns.place):
        np.add.at(information, np.ix_(place, place), np.asarray(found.information[r]))
        np.add.at(score, place, np.asarray(found.score[r]))
    return information[:size, :size], score[:size]


def invert(information: Float[np.ndarray, "g g"]) -> Float[np.ndarray, "g g"]:
    """Inverse of an information matrix; what cannot be seen has an infinite error."""
    diagonal = np.diag(information)
    dead = ~(diagonal > 0)
    scale = np.where(dead, 1.0, np.sqrt(np.where(dead, 1.0, diagonal)))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    least = (
        np.finfo(float).eps
        * max(1, len(values))
        * max(np.max(values, initial=0), 1e-300)
    )
    inverse = (vectors / np.maximum(values, least)) @ vectors.T
    inverse = inverse / np.outer(scale, scale)
    inverse[dead, dead] = np.inf
    return inverse


def prior_cost(problem: Problem, columns: Columns, point: Point, prior: bool) -> float:
    """Squared distance of the free numbers from what was known of them."""
    if not prior or not len(columns.scale):
        return 0.0
    off = off_nominal(problem, columns, point)
    return float(np.sum(prior_information(problem, columns, True) * off**2))


def _step(problem, columns, blocks, point, damping, prior):
    """One damped step, within the bounds; and by how much it should lower the cost."""
    found = eliminate(blocks)
    size = len(columns.scale)
    information, score = _gathered(columns, found)
    strength = prior_information(problem, columns, prior)
    information = information + np.diag(strength)
    if size:
        score = score - strength * off_nominal(problem, columns, point)
    change = _bounded(problem, columns, point, information, score, damping)
    filled = np.append(change, 0.0)[columns.place]
    states = step_of(found, jnp.asarray(filled))
    values = np.array(point.values)
    for r, (place, local) in enumerate(zip(columns.place, columns.local)):
        used = place >= 0
        values[r, local[used]] += change[place[used]] * columns.scale[place[used]]
    # what the quadratic model of the cost says of the whole step
    gain = float(change @ score) + _state_gain(blocks, found)
    moved = Point(jnp.asarray(values), point.states + states)
    return moved, gain


def _state_gain(blocks: Blocks, found) -> float:
    """What the states alone would gain: scores times steps at unchanged parameters."""
    none = jnp.zeros((found.score.shape[0], found.score.shape[1]))
    return float(jnp.sum(blocks.s * step_of(found, none)))


def _bounded(problem, columns, point, information, score, damping):
    """Newton's step with the numbers that press against a bound held at it."""
    size = len(columns.scale)
    change = np.zeros(size)
    if not size:
        return change
    values = np.asarray(point.values)
    now = values[np.maximum(columns.record, 0), columns.parameter]
    low = np.array([problem.parameters[p].lower for p in columns.parameter])
    high = np.array([problem.parameters[p].upper for p in columns.parameter])
    low, high = (low - now) / columns.scale, (high - now) / columns.scale
    held = np.zeros(size, dtype=bool)
    damped = information + damping * np.eye(size)
    for _ in range(size):
        open_ = ~held
        if not np.any(open_):
            break
        right = score[open_] - damped[np.ix_(open_, held)] @ change[held]
        change[open_] = np.linalg.solve(damped[np.ix_(open_, open_)], right)
        beyond = open_ & ((change < low) | (change > high))
        if not np.any(beyond):
            break
        change = np.clip(change, low, high)
        held |= beyond
    return np.clip(change, low, high)


def off_nominal(problem: Problem, columns: Columns, point: Point):
    """Distance of each free number from its nominal value, in scales."""
    values = np.asarray(point.values)
    now = values[np.maximum(columns.record, 0), columns.parameter]
    nominal = np.array([_nominal(problem, p) for p in columns.parameter])
    return (now - nominal) / columns.scale


def _nominal(problem: Problem, place: int) -> float:
    parameter: Parameter = problem.parameters[place]
    if parameter.nominal is not None:
        return parameter.nominal
    return float(problem.start.values[0, place])


def prior_information(problem: Problem, columns: Columns, prior: bool):
    stderr = np.array([problem.parameters[p].prior_stderr for p in columns.parameter])
    return (columns.scale / stderr) ** 2 if prior else np.zeros(len(columns.scale))


def _inside(problem: Problem, columns: Columns, point: Point) -> Point:
    """The point, moved inside the bounds of the free parameters."""
    values = np.array(point.values)
    for p in set(columns.parameter.tolist()):
        one = problem.parameters[p]
        values[:, p] = np.clip(values[:, p], one.lower, one.upper)
    return point._replace(values=jnp.asarray(values))


def _total(costs: Costs, extras) -> float:
    """Cost of all pieces by their weights; a joint counts as the less of its two."""
    before = jnp.concatenate([extras.weight[:, :1], extras.weight[:, :-1]], axis=1)
    shared = jnp.minimum(extras.weight, before)
    parts = (
        jnp.sum(extras.weight * costs.flown),
        jnp.sum(shared * costs.joints),
        jnp.sum(extras.rest_weight * costs.rested),
    )
    return float(sum(parts))
