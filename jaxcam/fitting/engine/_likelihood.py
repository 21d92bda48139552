"""Likelihood of a sample, with the derivatives that Fisher scoring needs."""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.special import log_ndtr
from jaxtyping import Array, Float

from ._model import Sensor
from ._scaled_erfc import scaled_erfc


# Distance of a prediction from the interval of a rounded sample, in standard deviations
# of the noise, beyond which the information follows from the slope of the cost
_FAR = 5.0
# Resolution, in standard deviations of the noise, below which rounding has no effect
_FINE = 1e-5
_ROOT_HALF = math.sqrt(0.5)


class Scored(NamedTuple):
    """Cost, score and information of each sample.

    - `cost`: minus twice the log-likelihood, shifted by a constant so that it is 1 on
        average for Gaussian noise.
    - `score`: derivative of the log-likelihood with respect to the prediction.
    - `information`: the expected square of the score.
    """

    cost: Float[Array, "..."]
    score: Float[Array, "..."]
    information: Float[Array, "..."]


def score(sensor: Sensor, value, predicted) -> Scored:
    """Evaluate the likelihood of `value`, given the noise-free prediction
    `predicted`.
    """
    found = _within(sensor, value, predicted)
    if math.isinf(sensor.limit):
        return found
    # a saturated sample only implies that the true value was beyond the limit
    over = jnp.abs(value) >= sensor.limit - sensor.resolution / 2
    censored = _beyond(sensor, value, predicted)
    return Scored(*(jnp.where(over, c, w) for c, w in zip(censored, found)))


def _within(sensor: Sensor, value, predicted) -> Scored:
    off = value - predicted
    if not math.isinf(sensor.tails):
        # Student's distribution, scaled by the standard deviation of noise and rounding
        nu, variance = sensor.tails, sensor.floor**2
        square = off * off / variance
        return Scored(
            (nu + 1) * jnp.log1p(square / nu),
            (nu + 1) / (nu + square) * off / variance,
            jnp.ones_like(off) * ((nu + 1) / (nu + 3) / variance),
        )
    if sensor.resolution == 0:
        variance = sensor.noise**2
        one = jnp.ones_like(off)
        return Scored(off * off / variance, off / variance, one / variance)
    return _rounded(sensor, off)


def _rounded(sensor: Sensor, off) -> Scored:
    """Return the likelihood of noise followed by rounding: the probability of an
    interval.

    The probability is Q(a) - Q(b), with (a, b) = (|off| -+ resolution / 2) / noise and
    Q(x) = exp(-x**2 / 2) scaled_erfc(x / sqrt(2)) / 2. The factor exp(-a**2 / 2), which
    underflows, is taken out of the logarithm.
    """
    size, half = jnp.abs(off), sensor.resolution / 2
    variance = sensor.floor**2
    a, b = (size - half) / sensor.noise, (size + half) / sensor.noise
    inside = a < 0
    least = jnp.where(inside, a * a, 0.0)
    beyond = jnp.where(inside, 0.0, a * a)
    # the density falls by this fraction between a and b
    fall = -jnp.expm1(-sensor.resolution * size / sensor.noise**2)
    near = scaled_erfc(jnp.abs(a) * _ROOT_HALF) / 2
    rest = (1 - fall) * scaled_erfc(b * _ROOT_HALF) / 2
    density = jnp.exp(-0.5 * least)
    chance = jnp.where(inside, 1 - density * (near + rest), near - rest)
    # in a very short interval, the density is constant, and the difference is lost
    fine = sensor.resolution < _FINE * sensor.noise
    chance = jnp.where(fine, 1.0, chance)
    pull = -density * fall / (chance * math.sqrt(2 * math.pi))
    # the constant normalises the cost for Gaussian noise of the same variance
    constant = jnp.log(sensor.resolution**2 / (2 * jnp.pi * variance))
    cost = constant - 2 * jnp.log(chance) + beyond
    cost = jnp.where(fine, off * off / variance, cost)
    slope = jnp.where(fine, off / variance, -jnp.sign(off) * pull / sensor.noise)
    # only poor starting values lead this far from the interval; there, the cost is
    # steeper than the mean information predicts, so a step based on the mean
    # information would be too long
    far = size > half + _FAR * sensor.noise
    safe = jnp.where(far, off, 1.0)
    information = jnp.where(far, slope / safe, 1 / variance)
    return Scored(cost, slope, information)


def _beyond(sensor: Sensor, value, predicted) -> Scored:
    """Return the likelihood of a true value beyond the limit, Phi(z)."""
    z = (jnp.sign(value) * predicted - sensor.limit) / sensor.noise
    chance = log_ndtr(z)
    ratio = jnp.exp(_log_density(z) - chance)
    # minus the second derivative of log Phi; its expected value is the information
    bend = ratio * (z + ratio)
    return Scored(
        -2 * chance,
        jnp.sign(value) * ratio / sensor.noise,
        jnp.clip(bend, 0.0, 1.0) / sensor.noise**2,
    )


def _log_density(z):
    return -0.5 * z * z - 0.5 * jnp.log(2 * jnp.pi)


def score_all(sensors, values, predicted) -> Scored:
    """Evaluate the likelihood of all channels, which are along the last axis."""
    columns = [
        score(sensor, values[..., k], predicted[..., k])
        for k, sensor in enumerate(sensors)
    ]
    return jax.tree.map(lambda *parts: jnp.stack(parts, axis=-1), *columns)
