"""Fit parameters to complete free runs, the criterion used in benchmarks."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from ..hybrid.programs import program
from ..parameters import as_arrays
from ..recordings import Recording, Segments
from ._free_run import free_run, FreeRun
from ._free_run_motion import Prepared, prepared, restarted, simulated
from .engine import (
    Layout,
    Model,
    Parameter,
    parameter_places,
    with_constants,
)


# Maximum number of updates of the initial states, and change of the parameters (in
# units of their scales) below which no further update is needed
_ROUNDS, _SETTLED = 4, 1e-2
# Maximum number of evaluations of the residuals between two updates
_EVALUATIONS = 40


@dataclasses.dataclass(frozen=True)
class FreeRunFit:
    """Parameters that minimise the error of free runs."""

    model: Model
    """The model with the fitted parameters."""
    values: Mapping[str, float]
    """Values of the parameters by name."""
    runs: tuple[FreeRun, ...]
    """The free run of each recording."""
    converged: bool
    """Whether the last update of the initial states left the optimum nearly unchanged.
    """


def fit_free_run(
    model: Model,
    recordings: Sequence[Recording | Segments],
    parameters: Sequence[Parameter],
    *,
    start: Mapping[str, float] | None = None,
    samples: int = 20,
    progress: Callable[[int, float], None] | None = None,
) -> FreeRunFit:
    """Fit parameters to complete free runs.

    `fit` compares each piece of a recording with a prediction from the preceding piece,
    and estimates the standard error of each parameter. This function minimises the
    error of a simulation that starts from the first samples and covers the complete
    recording. The effect of a model discrepancy accumulates in the simulation and
    biases the parameters, so no standard errors are given. Channels are weighted by the
    inverse of their noise.

    Args:
        model: A system with its sensors and its input.
        recordings: Evenly sampled recordings without impacts; each parameter has the
            same value in all of them.
        parameters: Parameters to fit; bounds and scales are used, tolerances are not.
        start: Initial values of some parameters; default: those of the model.
        samples: Number of samples from which the initial state of a recording is
            estimated.
        progress: Called after each evaluation with its number and the cost (half the
            sum of squared residuals, in units of the noise).

    Returns:
        A `FreeRunFit`.

    Raises:
        RecordingError: See `free_run`.
        ValueError: A parameter is not a single number of the model, or `start` names an
            unknown parameter; see also `free_run`.

    Examples:
        >>> from jaxcam.fitting import fit_free_run, Model, Parameter, Sensor
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import Recording
        >>> time = 1e-3 * np.arange(200)
        >>> fallen = Recording("drop", time, {"height_m": 1.0 - 4.905 * time**2})
        >>> sensors = {"height_m": Sensor(0, noise=1e-4)}
        >>> model = Model(BouncingBall(gravity=9.0), sensors)
        >>> gravity = Parameter("gravity", lambda m: m.system.gravity)
        >>> round(fit_free_run(model, [fallen], [gravity]).values["gravity"], 4)
        9.81
    """
    model = as_arrays(model)
    places = parameter_places(model, parameters)
    runs = [r.recording if isinstance(r, Segments) else r for r in recordings]
    layouts = [Layout(with_constants(model, run), places) for run in runs]
    given = dict(start or {})
    names = [one.name for one in parameters]
    wrong = [name for name in given if name not in names]
    if wrong:
        raise ValueError(
            f"There is no parameter {wrong[0]!r} to start from; the parameters are "
            f"{', '.join(names)}."
        )
    values = np.array([given.get(p.name, float(p.where(model))) for p in parameters])
    scale = np.array([one.size(x) for one, x in zip(parameters, values)])
    low, high = (
        np.array([getattr(one, side) for one in parameters], dtype=float)
        for side in ("lower", "upper")
    )
    values = np.clip(values, low, high)
    settled, counted = False, itertools.count(1)
    for _ in range(_ROUNDS):
        ready = [
            (layout, prepared(layout.at(jnp.asarray(values)), run, samples))
            for layout, run in zip(layouts, runs)
        ]
        found = least_squares(
            _told(partial(_missed, ready), progress, counted),
            values,
            partial(_slopes, ready, scale),  # pyright: ignore
            bounds=(low, high),
            x_scale=scale,
            max_nfev=_EVALUATIONS,
        )
        moved = np.max(np.abs(found.x - values) / scale, initial=0.0)
        values = found.x
        settled = bool(found.success and moved < _SETTLED)
        if settled:
            break
    best = Layout(model, places).at(jnp.asarray(values))
    return FreeRunFit(
        best,
        dict(zip(names, values.tolist())),
        tuple(free_run(best, run, samples=samples) for run in recordings),
        settled,
    )


def _missed(ready: Sequence[tuple[Layout, Prepared]], values):
    """Return the residuals of all recordings, in units of the noise."""
    parts = [_off(*one, jnp.asarray(values)) for one in ready]
    return _sound(np.concatenate(parts))


def _told(missed, progress, counted):
    """Report the number and the cost of each evaluation of the residuals."""
    if progress is None:
        return missed

    def evaluated(values):
        found = missed(values)
        progress(next(counted), float(found @ found) / 2)
        return found

    return evaluated


def _slopes(ready: Sequence[tuple[Layout, Prepared]], scale, values):
    """Return the derivatives of the residuals with respect to the parameters."""
    units = jnp.asarray(scale)
    rows = [_along(*one, jnp.asarray(values), units) for one in ready]
    return _sound(np.concatenate(rows, axis=1).T) / scale


def _sound(numbers):
    # the residuals of a motion that does not stay finite count as very large errors
    return np.nan_to_num(numbers, nan=1e12, posinf=1e12, neginf=-1e12)


@program
def _off(layout: Layout, one: Prepared, values):
    model = layout.at(values)
    found = simulated(model, restarted(model, one)).channels
    missed = (found - one.data) / one.noise[None]
    missed = jnp.where(jnp.isfinite(one.data), missed, 0.0)
    # the samples from which the initial state was estimated do not count
    counts = jnp.arange(missed.shape[0]) >= one.samples
    return jnp.ravel(jnp.where(counts[:, None], missed, 0.0))


@program
def _along(layout: Layout, one: Prepared, values, scale):
    def moved(unit):
        return jax.jvp(lambda x: _off(layout, one, x), (values,), (unit * scale,))[1]

    return jax.vmap(moved)(jnp.eye(values.shape[0]))
