"""The period-doubling cascade of a one-dimensional map."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..hybrid.programs import program


_NEWTON = 30
_EXACT = 1e-13


def superstable(
    system: eqx.Module, where: Callable, critical, first: tuple, count: int
) -> Float[np.ndarray, " count"]:
    """Return the parameter values at which the critical point has period 1, 2, 4, ...,
    2^(count - 1).

    There is one such value in each window of the cascade, and these values accumulate
    at the same rate as the period doublings. Each value is found by Newton's method,
    starting from an extrapolation of the previous ones.

    Args:
        system: The map, an `equinox.Module`.
        where: Selects the parameter.
        critical: The critical point, at which the derivative of the map is zero.
        first: Initial guesses for the first two parameter values.
        count: Number of parameter values.

    Returns:
        The parameter values, shape `(count,)`.

    Raises:
        ValueError: Newton's method does not converge; rounding limits `count` to about
            thirteen.

    Examples:
        >>> from jaxcam.maps import LogisticMap, superstable
        >>> found = superstable(LogisticMap(), lambda m: m.mu, 0.5, (2.0, 3.2), 3)
        >>> found.round(4).tolist()
        [2.0, 3.2361, 3.4986]
    """
    found: list[float] = []
    for k in range(count):
        if k < 2:
            guess = first[k]
        else:
            ratio = (found[-1] - found[-2]) / (found[-2] - found[-3]) if k > 2 else 0.23
            guess = found[-1] + ratio * (found[-1] - found[-2])
        value, step = _newton(system, where, float(critical), float(guess), 2**k)
        half = _miss(system, where, float(critical), value, jnp.asarray(2**k // 2))[0]
        if not (step < 1e-9 and (k == 0 or abs(float(half)) > 1e-7)):
            raise ValueError(
                f"No superstable orbit of period {2**k} was found near {guess:g}; give "
                "other guesses in `first`, or a smaller `count`."
            )
        found.append(value)
    return np.array(found)


def feigenbaum_ratios(parameters: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    """Return (m_k - m_(k-1)) / (m_(k+1) - m_k), which tends to 4.669 (thesis,
    eq. 2.17).

    Args:
        parameters: Parameter values m_k of a period-doubling cascade, shape `(n,)`.

    Returns:
        Ratios, shape `(n - 2,)`.

    Examples:
        >>> from jaxcam.maps import feigenbaum_ratios
        >>> feigenbaum_ratios(np.array([0.0, 4.0, 5.0])).tolist()
        [4.0]
    """
    steps = np.diff(parameters)
    return steps[:-1] / steps[1:]


def _newton(system, where, critical, value, period):
    step = np.inf
    for _ in range(_NEWTON):
        miss, slope = _miss(system, where, critical, value, jnp.asarray(period))
        step = float(miss) / float(slope)
        value -= step
        if abs(step) < _EXACT * max(1.0, abs(value)):
            break
    return value, abs(step)


@program
def _miss(system, where, critical, value, period):
    def distance(parameter):
        moved = eqx.tree_at(where, system, parameter)
        end = jax.lax.fori_loop(
            0, period, lambda _, x: moved(x), jnp.asarray(critical, dtype=float)
        )
        return end - critical

    value = jnp.asarray(value, dtype=float)
    return jax.jvp(distance, (value,), (jnp.ones_like(value),))
