"""Fit the initial state of each flight to the recording.

All flights of a recording are fitted together, padded to the longest of them, in one
compiled program that is shared by all recordings of similar size.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ...hybrid import HybridSystem
from ...hybrid.programs import program
from ...hybrid.runge_kutta import array_step, RK4
from .._errors import RecordingError
from ..cut import fit_local, padded


Observe = Mapping[str, int | Callable[[Array], Array]]
"""Channels as functions of the state: the index of a component, or a function."""

_ITERATIONS = 8
# Allowed change of a flight (in units of the noise) when the steps are halved
_STEP_ERROR = 0.01
_MOST_SUBSTEPS = 64


class FlightFits(NamedTuple):
    """Fits of `b` flights of at most `k` samples in `c` channels.

    - `state`: state at the first sample of each flight, shape `(b, n)`.
    - `covariance`: covariance of that state due to the noise alone, shape `(b, n, n)`.
    - `residual`: recording minus model, shape `(b, c, k)`, zero where padded.
    """

    state: Float[np.ndarray, "b n"]
    covariance: Float[np.ndarray, "b n n"]
    residual: Float[np.ndarray, "b c k"]


def fit_flights(
    system: HybridSystem,
    times: Sequence[Float[np.ndarray, " _"]],
    samples: Sequence[Float[np.ndarray, "c _"]],
    clocks: Sequence[float],
    observe: Sequence[int | Callable[[Array], Array]],
    noise: Float[np.ndarray, " c"],
    size: int,
) -> FlightFits:
    """Fit the initial state of every flight by Gauss-Newton.

    **Arguments:**

    - `times` `(k,)`, `samples` `(c, k)`: data of each flight; k may differ.
    - `clocks`: time of the model at the first sample of each flight (s).
    - `observe`: each channel as a function of the state.
    - `noise`: standard deviation of each channel.
    - `size`: number of components of the state.
    """
    flights, longest = len(times), max(len(time) for time in times)
    # the arrays are padded generously, so that recordings share a compiled program
    rows, width = 48 * -(-flights // 48), 1024 * -(-longest // 1024)
    time = np.zeros((rows, width))
    values = np.zeros((rows, len(observe), width))
    mask = np.zeros((rows, width), dtype=bool)
    start, rates = np.zeros((2, rows, len(observe)))
    clock = np.zeros(rows)
    clock[:flights] = clocks
    for row, (t, y) in enumerate(zip(times, samples)):
        time[row], values[row, :, 0] = t[-1] - t[0], y[:, 0]
        time[row, : len(t)] = t - t[0]
        values[row, :, : len(t)] = y
        mask[row, : len(t)] = True
        for column, channel in enumerate(y):
            early = slice(0, max(4, len(t) // 3))
            fit = fit_local(t[early], channel[early], noise[column], t[0])
            start[row, column] = fit.value(t[0])
            rates[row, column] = fit.slope(t[0])

    picks = tuple(observe)
    guess = _match(system, picks, clock, start, rates, np.zeros((rows, size)))
    substeps = 1
    while True:
        state, covariance, predicted = _fit(
            system, picks, substeps, guess, clock, time, values, mask, noise
        )
        finer = _predict_all(system, picks, 2 * substeps, state, clock, time)
        change = np.abs(finer - predicted) / noise[:, None]
        change = np.max(np.where(mask[:, None], change, 0.0))
        if not change > _STEP_ERROR or substeps >= _MOST_SUBSTEPS:
            break
        substeps *= 4
    residual = np.where(mask[:, None], values - np.asarray(finer), 0.0)
    return FlightFits(
        np.asarray(state)[:flights],
        np.asarray(covariance)[:flights],
        residual[:flights, :, :longest],
    )


def state_at(
    system: HybridSystem,
    observe: Sequence[int | Callable[[Array], Array]],
    clock: Float[np.ndarray, " b"],
    values: Float[np.ndarray, "b c"],
    rates: Float[np.ndarray, "b c"],
    size: int,
) -> Float[np.ndarray, "b n"]:
    """Find states whose channels have these values and rates of change, by Newton's
    method. If they do not determine the state, the solution nearest to zero is
    returned.
    """
    count = len(clock)
    clock, values, rates = padded(clock), padded(values), padded(rates)
    guess = np.zeros((len(clock), size))
    state = _match(system, tuple(observe), clock, values, rates, guess)
    return np.asarray(state)[:count]


def observed(pick: int | Callable[[Array], Array], state: Array) -> Array:
    """Return one channel of a state as a scalar."""
    return state[pick] if isinstance(pick, int) else jnp.asarray(pick(state))


def rate_of(system, picks, clock, state) -> Array:
    """Return the rates of change of all channels in free flight, shape `(c,)`."""
    field = system.vector_field(clock, state)
    return jax.jvp(lambda x: _channels(picks, x), (state,), (field,))[1]


def _channels(picks, state):
    return jnp.stack([observed(pick, state) for pick in picks])


def _predict(system, picks, substeps, state, clock, time):
    """Predict channels at each time of one flight, shape `(c, k)`, by Runge-Kutta."""

    def step(carry, t1):
        t0, x0 = carry
        h = (t1 - t0) / substeps

        def substep(i, x):
            t = clock + t0 + i * h
            return array_step(RK4, system.vector_field, t, x, h, unrolled=True)[0]

        # unrolled if there are few steps, because a loop would cost more than the steps
        x1 = x0
        if substeps <= 2:
            for i in range(substeps):
                x1 = substep(float(i), x1)
        else:
            x1 = jax.lax.fori_loop(0, substeps, substep, x1)
        return (t1, x1), _channels(picks, x1)

    return jax.lax.scan(step, (time[0], state), time)[1].T


@program
def _predict_all(system, picks, substeps, state, clock, time) -> Float[Array, "b c k"]:
    def one(state, clock, time):
        return _predict(system, picks, substeps, state, clock, time)

    return jax.vmap(one)(state, jnp.asarray(clock), jnp.asarray(time))


@program
def _fit(system, picks, substeps, guess, clock, time, values, mask, noise):
    noise = jnp.asarray(noise)

    def one(guess, clock, time, values, mask: Bool[Array, " k"]):
        def predicted(state):
            channels = _predict(system, picks, substeps, state, clock, time)
            return channels, channels

        def normal(state):
            jacobian, channels = jax.jacfwd(predicted, has_aux=True)(state)
            weight = jnp.where(mask, 1.0, 0.0)[None, :] / noise[:, None]
            rows = (jacobian * weight[..., None]).reshape(-1, len(state))
            misfit = ((values - channels) * weight).reshape(-1)
            return rows.T @ rows, rows.T @ misfit

        def iterate(_, state):
            matrix, target = normal(state)
            return state + _inverse(matrix) @ target

        state = jax.lax.fori_loop(0, _ITERATIONS, iterate, guess)
        matrix, _ = normal(state)
        return state, _inverse(matrix), predicted(state)[0]

    arrays = (jnp.asarray(a) for a in (guess, clock, time, values, mask))
    return jax.vmap(one)(*arrays)


def _inverse(matrix):
    """Return the inverse of a normal matrix, with zero rows for undetermined
    components.
    """
    scale = jnp.sqrt(jnp.maximum(jnp.diagonal(matrix), 1e-300))
    scales = jnp.outer(scale, scale)
    return jnp.linalg.pinv(matrix / scales, rtol=1e-12, hermitian=True) / scales


@program
def _match(system, picks, clock, values, rates, guess):
    def one(clock, values, rates, guess):
        target = jnp.concatenate([values, rates])

        def seen(state):
            channels = _channels(picks, state)
            return jnp.concatenate([channels, rate_of(system, picks, clock, state)])

        def iterate(_, state):
            jacobian = jax.jacfwd(seen)(state)
            return state + jnp.linalg.pinv(jacobian) @ (target - seen(state))

        return jax.lax.fori_loop(0, 4, iterate, guess)

    arrays = (jnp.asarray(a) for a in (clock, values, rates, guess))
    return jax.vmap(one)(*arrays)


def size_of(system: HybridSystem, observe: Observe) -> int:
    """Return the number of components of the state."""
    if system.state_names:
        return len(system.state_names)
    picks = [pick for pick in observe.values() if isinstance(pick, int)]
    for size in range(max(picks, default=0) + 1, 64):
        # a vector field that unpacks its state accepts only one size, which is found by
        # trying
        try:
            shape = jax.eval_shape(
                lambda state: system.vector_field(jnp.asarray(0.0), state),
                jax.ShapeDtypeStruct((size,), float),
            ).shape
        except (ValueError, TypeError, IndexError):
            continue
        if shape == (size,):
            return size
    raise RecordingError(
        f"The number of states of {type(system).__name__} is unknown; declare its "
        f"`state_names`."
    )
