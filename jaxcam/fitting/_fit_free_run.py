"""Parameters by the error of whole free runs, as benchmarks judge a model."""

import dataclasses
from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from ..recordings import Recording, Segments
from ._free_run import free_run, FreeRun, Prepared, prepared, simulated
from .engine import Layout, Model, Parameter, parameter_places


# How often initial states are found anew; change of the error at which that ends
_ROUNDS, _SETTLED = 4, 1e-4
# Evaluations of a round at most
_EVALUATIONS = 40


@dataclasses.dataclass(frozen=True)
class FreeRunFit:
    """The parameters with which free runs miss recordings least.

    - `model`: with these parameters; `values` of them, by name.
    - `runs`: the free run of each recording.
    - `converged`: whether the search ended at an optimum near its start.
    """

    model: Model
    values: Mapping[str, float]
    runs: tuple[FreeRun, ...]
    converged: bool


def fit_free_run(
    model: Model,
    recordings: Sequence[Recording | Segments],
    parameters: Sequence[Parameter],
    *,
    samples: int = 20,
) -> FreeRunFit:
    """Fit parameters to whole free runs.

    `fit` asks whether each piece of a recording follows from the one before, and says
    how well each parameter is known. This asks how far a simulation from the first
    samples strays in the end; what the model lacks adds up, and parameters are bent to
    make up for it, so no errors are given. Channels count in units of their noise.

    **Arguments:**

    - `model`: with the values to start from.
    - `recordings`: without impacts, evenly sampled; one value of each parameter serves
        all of them.
    - `parameters`: those to fit; bounds and scales count, tolerances do not.
    - `samples`: how many samples the initial state of a recording is found from.

    **Raises:** as `free_run` does; `ValueError` for a parameter that is not one number
    of the model.
    """
    model = jax.tree.map(_array, model)
    layout = Layout(model, parameter_places(model, parameters))
    values = np.array([float(one.where(model)) for one in parameters])
    scale = np.array([one.size(x) for one, x in zip(parameters, values)])
    low, high = (
        np.array([getattr(one, side) for one in parameters], dtype=float)
        for side in ("lower", "upper")
    )
    values = np.clip(values, low, high)
    ready, error, settled = (), np.inf, False
    for _ in range(_ROUNDS):
        here = layout.at(jnp.asarray(values))
        ready = tuple(prepared(here, run, samples) for run in recordings)
        found = least_squares(
            lambda x: _missed(layout, ready, x),
            values,
            lambda x: _slopes(layout, ready, x, jnp.asarray(scale)) / scale,
            bounds=(low, high),
            x_scale=scale,
            max_nfev=_EVALUATIONS,
        )
        values = found.x
        settled = bool(found.success and abs(error - found.cost) < _SETTLED * error)
        if settled or found.cost >= error:
            break
        error = found.cost
    best = layout.at(jnp.asarray(values))
    return FreeRunFit(
        best,
        {one.name: float(x) for one, x in zip(parameters, values)},
        tuple(free_run(best, run, samples=samples) for run in recordings),
        settled,
    )


def _array(leaf):
    return jnp.asarray(leaf, dtype=float) if isinstance(leaf, float) else leaf


def _missed(layout: Layout, ready: Sequence[Prepared], values):
    """What all recordings miss, in units of the noise and of all samples."""
    parts = [_off(layout, one, jnp.asarray(values)) for one in ready]
    return _sound(np.concatenate(parts))


def _slopes(layout: Layout, ready: Sequence[Prepared], values, scale):
    """Derivatives of that to the parameters, in units of their scales."""
    rows = [_along(layout, one, jnp.asarray(values), scale) for one in ready]
    return _sound(np.concatenate(rows, axis=1).T)


def _sound(numbers):
    # a motion that is lost is very far off
    return np.nan_to_num(numbers, nan=1e12, posinf=1e12, neginf=-1e12)


@eqx.filter_jit
def _off(layout: Layout, one: Prepared, values):
    found = simulated(layout.at(values), one).channels
    missed = (found - one.data) / one.noise[None]
    missed = jnp.where(jnp.isfinite(one.data), missed, 0.0)
    # the samples that the state was found from do not count
    counts = jnp.arange(missed.shape[0]) >= one.samples
    return jnp.ravel(jnp.where(counts[:, None], missed, 0.0))


@eqx.filter_jit
def _along(layout: Layout, one: Prepared, values, scale):
    def moved(unit):
        return jax.jvp(lambda x: _off(layout, one, x), (values,), (unit * scale,))[1]

    return jax.vmap(moved)(jnp.eye(values.shape[0]))
