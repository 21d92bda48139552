"""Index the free values of a fit; form their priors and normal equations."""

import dataclasses
from collections.abc import Iterable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ._eliminate import eliminate_states, LEAST
from ._extras import Extras
from ._linearise import assemble, Blocks, Costs, Point
from ._problem import Problem
from ._sharpness import shared_width


# Information below minus this fraction of the largest of its recording is lost to
# rounding
_NEGATIVE = 1e-6


@dataclasses.dataclass(frozen=True)
class Columns:
    """The free values of a fit: one per free parameter, or one per parameter and
    recording.

    `local` `(r, m)`: the parameter to which each column of a recording's equations
    belongs; `place` `(r, m)`: its index among the free values, -1 for padding.
    """

    parameter: Int[np.ndarray, " g"]
    """Index of the parameter of each free value, shape `(g,)`."""
    record: Int[np.ndarray, " g"]
    """Index of the recording of each free value, -1 for all recordings, shape `(g,)`.
    """
    local: Int[np.ndarray, "r m"]
    """Index of the parameter of each column of a recording's equations, shape `(r, m)`.
    """
    place: Int[np.ndarray, "r m"]
    """Index of the column among the free values, -1 for padding, shape `(r, m)`."""
    scale: Float[np.ndarray, " g"]
    """Scale of each free value, shape `(g,)`."""

    @property
    def scales(self) -> Float[np.ndarray, "r m"]:
        """Scale of each column of `local`, zero for padding, shape `(r, m)`."""
        padded = np.append(self.scale, 0.0)
        return padded[self.place]

    def labels(self, problem: Problem) -> tuple[str, ...]:
        """Return the name of each free value: that of its parameter, with `@record` if
        each recording has its own value.
        """
        return tuple(
            problem.names[p] if r < 0 else f"{problem.names[p]}@{problem.records[r]}"
            for p, r in zip(self.parameter, self.record)
        )


def free_columns(problem: Problem, free: Iterable[str] | None) -> Columns:
    """Return the free values of a problem, given the names of the parameters.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        problem: The problem.
        free: Names of the parameters; `None` for all.

    Returns:
        The [`jaxcam.fitting.engine.Columns`][].

    Raises:
        ValueError: A name is unknown, or its values are known constants.

    Examples:
        >>> from jaxcam.fitting.engine import free_columns
        >>> columns = free_columns(problem, None)
        >>> columns.labels(problem), columns.scale.tolist()
        (('gravity',), [1.0])
    """
    if free is None:
        free = [one.name for one in problem.parameters if one.known is None]
    wanted = tuple(free)
    for name in wanted:
        if problem.parameter(name).known is not None:
            raise ValueError(
                f"The parameter {name!r} is known for each recording; leave it out of "
                "the `constants` of the recordings to fit it."
            )
    records = len(problem.segments)
    picked = [k for k, p in enumerate(problem.parameters) if p.name in wanted]
    parameter, record, scale = [], [], []
    width = shared_width(len(picked), len(problem.names))
    place = -np.ones((records, width), dtype=int)
    local = np.zeros_like(place)
    for column, k in enumerate(picked):
        one = problem.parameters[k]
        size = one.size(nominal_of(problem, k))
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


def linearised(
    problem: Problem, columns: Columns, extras: Extras, point: Point
) -> tuple[Blocks, Costs]:
    """Return the normal equations of the free values about a point, and the costs.

    Args:
        problem: The problem.
        columns: The free values.
        extras: Further arguments of the compiled programs, such as those from
            `Problem.weighted`.
        point: The point.

    Returns:
        Normal equations and costs, as from `assemble`.
    """
    local, scales = jnp.asarray(columns.local), jnp.asarray(columns.scales)
    return assemble(problem.layout, problem.pieces, extras, point, local, scales)


def reduced(columns: Columns, blocks: Blocks):
    """Return the information and score of the free values, in units of their scales."""
    return gathered(columns, eliminate_states(blocks))


def sound_information(columns: Columns, blocks: Blocks):
    """Return the `reduced` information without the recordings in which it is lost to
    rounding, and the indices of these recordings.

    Information is never negative. It is found as a difference, which rounding makes
    negative if a piece is so sensitive, for example where a motion just sticks, that
    the difference is smaller than the rounding error of its terms.
    """
    found = eliminate_states(blocks)
    each = np.array(found.information)
    lost = np.zeros(len(each), dtype=bool)
    if np.all(np.isfinite(each)):
        values = np.linalg.eigvalsh(each)
        lost = values[:, 0] < -_NEGATIVE * np.abs(values).max(axis=1)
    each[lost] = 0.0
    return gathered(columns, found._replace(information=each))[0], np.flatnonzero(lost)


def held_firmer(columns: Columns, blocks: Blocks):
    """Return the `reduced` information with the states regularised a hundred times as
    strongly. Any part that grows does not come from the data.
    """
    return gathered(columns, eliminate_states(blocks, jnp.asarray(100 * LEAST)))[0]


def gathered(columns: Columns, found):
    """Return information and score of the free values, summed over the recordings."""
    size = len(columns.scale)
    information, score = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
    each = zip(columns.place, np.asarray(found.information), np.asarray(found.score))
    for place, inside, pull in each:
        np.add.at(information, np.ix_(place, place), inside)
        np.add.at(score, place, pull)
    return information[:size, :size], score[:size]


def invert_information(
    information: Float[np.ndarray, "g g"],
) -> Float[np.ndarray, "g g"]:
    """Return the inverse of a positive semidefinite information matrix.

    The matrix is scaled to a unit diagonal and inverted through its eigenvalues; any
    eigenvalue below the rounding error is replaced by the rounding error. An
    undetermined value (a zero on the diagonal) has an infinite variance.

    Args:
        information: The matrix, shape `(g, g)`.

    Returns:
        The inverse, shape `(g, g)`.

    Raises:
        ValueError: The matrix is not finite, for example because the model yields NaN.

    Examples:
        >>> from jaxcam.fitting.engine import invert_information
        >>> information = np.array([[4.0, 0.0], [0.0, 0.0]])
        >>> invert_information(information).tolist()  # the second value is undetermined
        [[0.25, 0.0], [0.0, inf]]
    """
    if not np.all(np.isfinite(information)):
        raise ValueError(
            "The sensitivities of the model to its parameters are not finite; check "
            "the units of the columns, and for NaN in the vector field, gap and impact "
            "at the fitted states."
        )
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


def off_nominal(problem: Problem, columns: Columns, point: Point):
    """Return the deviation of each free value from nominal, in units of its scale.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        problem: The problem.
        columns: The free values.
        point: The values.

    Returns:
        Deviations, shape `(g,)`.

    Examples:
        >>> from jaxcam.fitting.engine import free_columns, off_nominal
        >>> (off,) = off_nominal(problem, free_columns(problem, None), found.point)
        >>> bool(np.isclose(off, found.estimates[0].value - 9.81))  # the scale is 1
        True
    """
    values = np.asarray(point.values)
    now = values[np.maximum(columns.record, 0), columns.parameter]
    nominal = np.array([nominal_of(problem, p) for p in columns.parameter])
    return (now - nominal) / columns.scale


def nominal_of(problem: Problem, place: int | np.integer) -> float:
    """Return the nominal value of the parameter with this index."""
    return problem.parameters[place].nominal_in(float(problem.start.values[0, place]))


def prior_information(problem: Problem, columns: Columns, prior: bool):
    """Return the information that the tolerances contain, `(scale / stderr)^2`.

    It is zero with `prior=False`, and for a parameter without prior knowledge.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        problem: The problem.
        columns: The free values.
        prior: Whether the tolerances count.

    Returns:
        Information of each free value, shape `(g,)`.

    Examples:
        >>> from jaxcam.fitting.engine import free_columns, prior_information
        >>> columns = free_columns(problem, None)  # tolerance 1, stderr 1 / sqrt(3)
        >>> prior_information(problem, columns, prior=True).round(3).tolist()
        [3.0]
    """
    stderr = np.array([problem.parameters[p].prior_stderr for p in columns.parameter])
    return (columns.scale / stderr) ** 2 if prior else np.zeros(len(columns.scale))


def prior_cost(problem: Problem, columns: Columns, point: Point, prior: bool) -> float:
    """Return the squared distance of the free values from their priors."""
    if not prior or not len(columns.scale):
        return 0.0
    off = off_nominal(problem, columns, point)
    return float(np.sum(prior_information(problem, columns, True) * off**2))


def inside(problem: Problem, columns: Columns, point: Point) -> Point:
    """Return the point, moved to within the bounds of the free parameters."""
    values = np.array(point.values)
    for p in set(columns.parameter.tolist()):
        one = problem.parameters[p]
        values[:, p] = np.clip(values[:, p], one.lower, one.upper)
    return point._replace(values=jnp.asarray(values))
