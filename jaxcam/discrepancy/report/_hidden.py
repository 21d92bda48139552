"""Report a hidden element as a table, a formula and a sentence."""

import math

import jax
import jax.numpy as jnp
import numpy as np

from ...fitting import Fit
from ..search import Hidden
from ..terms import HiddenElement, Hysteresis, Relaxation, Resonator
from ._curves import graded
from ._words import quantity


# A resonance is shown from a tenth of its frequency to ten times that, a relaxation for
# five of its time constants
_DECADE, _TIMES = 10.0, 5.0
# Damping ratio above which the response hardly has a peak
_NO_PEAK = 0.5
# Integration steps of a hysteretic element between two successive points of its table
_STEPS = 20


def hidden_table(found: Fit, hidden: Hidden, points: int):
    """Tabulate the effect of an element against its argument, with standard errors.

    For a resonance, this is the magnitude of the force for a unit deflection against
    frequency (Hz). For a relaxation, it is the force against the time (s) after a unit
    deflection. For a hysteretic element, it is the force against the distance from a
    reversal at the internal state `-limit` (full slip, unless the element stiffens).

    **Returns:** the argument, values and errors, each `(points,)`, and the element.
    """
    names = list(found.problem.names)
    element = hidden.element(found.point, names)
    along = _argument(element, points)
    own = [n for n in hidden.coefficients if n not in hidden.free_motions]
    labels = [estimate.label for estimate in found.estimates]
    rows = [labels.index(name) for name in own]
    columns = [names.index(name) for name in own]
    values = jnp.asarray(np.asarray(found.point.values)[0])

    def curve(numbers):
        moved = values.at[jnp.asarray(columns)].set(numbers)
        return _curve(hidden.element_at(moved, names), along)

    start = values[jnp.asarray(columns)]
    slope = np.asarray(jax.jacfwd(curve)(start))
    covariance = found.covariance[np.ix_(rows, rows)]
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    square = np.einsum("kp,pq,kq->k", slope, covariance, slope)
    return along, np.asarray(curve(start)), np.sqrt(np.maximum(square, 0.0)), element


def _argument(element: HiddenElement, points: int) -> np.ndarray:
    if isinstance(element, Resonator):
        f = float(element.frequency)
        even = np.linspace(math.log(f / _DECADE), math.log(f * _DECADE), points)
        along = np.exp(graded(even, lambda x: _curve(element, np.exp(x))))
        along[np.argmin(np.abs(along - f))] = f
        return along
    if isinstance(element, Relaxation):
        return np.linspace(0.0, _TIMES * float(element.time), points)
    assert isinstance(element, Hysteresis)
    return np.linspace(0.0, _TIMES * float(element.limit), points)


def _curve(element, along):
    if isinstance(element, Resonator):
        return jnp.abs(jax.vmap(element.transfer)(jnp.asarray(along)))
    if isinstance(element, Relaxation):
        return element.by_state * jnp.exp(-jnp.asarray(along) / element.time)
    step = along[1] / _STEPS

    def advance(z, _):
        middle = z + step / 2 * element.slope(1.0, z)
        return z + step * element.slope(1.0, middle), z

    count = _STEPS * (len(along) - 1) + 1
    _, branch = jax.lax.scan(advance, -element.limit, None, count)
    return element.by_state * branch[::_STEPS]


def hidden_unit(element: HiddenElement, unit: str) -> str:
    """Return the unit of the tabulated values, given the unit of the coordinate."""
    return f"{unit}/s^2" if isinstance(element, Hysteresis) else "1/s^2"


def hidden_formula(element: HiddenElement) -> str:
    """Return the equations of the internal state z, then the force."""
    e = element
    force = f"{_n(e.by_state)}*z"  # pyright: ignore
    if isinstance(e, Resonator):
        w = f"{2 * math.pi * float(e.frequency):.5g}"
        state = f"z'' + 2*{_n(e.ratio)}*{w}*z' + {w}**2*z = position"
        force = _sum(force, (e.by_rate, "*z'"))
    elif isinstance(e, Relaxation):
        state = f"z' = velocity - z/{_n(e.time)}"
    else:
        assert isinstance(e, Hysteresis)
        # 1 - b follows from the rounded b, so that the printed numbers add up to one
        b = f"{float(e.beta):.4g}"
        sign = "-" if e.loading > 0 else "+"
        state = (
            f"z' = velocity*(1 {sign} ({b}*sign(velocity*z) + {_n(1 - float(b))})"
            f"*abs(z/{_n(e.limit)})**{_n(e.power)})"
        )
    away = f"*(position - {_n(e.middle)})"
    force = _sum(force, (e.stiffness, away), (e.damping, "*velocity"), (e.constant, ""))
    return f"{state}; {force}"


def _sum(first: str, *more) -> str:
    for value, text in more:
        value = float(value)
        if value != 0:
            sign = "-" if value < 0 else "+"
            first = f"{first} {sign} {_n(abs(value))}{text}"
    return first


def _n(value) -> str:
    return f"{float(value):.4g}"


def hidden_words(found: Fit, hidden: Hidden, element: HiddenElement, unit: str) -> str:
    """Describe the element in words."""
    first = hidden.kind.numbers[0]
    value = float(getattr(element, first.name))
    error = first.error(value, found[hidden.changes[0]].stderr)
    said = f"{value:.4g} +- {error:.1g}"
    if isinstance(element, Resonator) and element.ratio > _NO_PEAK:
        return (
            "a force with an internal state: a strongly damped oscillator, driven by "
            f"the motion, with a natural frequency of {said} Hz and a damping ratio "
            f"of {float(element.ratio):.2g}"
        )
    if isinstance(element, Resonator):
        return (
            f"a resonance at {said} Hz with {100 * float(element.ratio):.2g} % "
            "damping, driven by the motion (including impacts), like the surge of a "
            "spring"
        )
    if isinstance(element, Relaxation):
        return (
            "a force with an internal state: it resists a deflection and relaxes over "
            f"{said} s, like rubber, or a spring and a dashpot in series"
        )
    assert isinstance(element, Hysteresis)
    if element.loading < 0:
        return (
            "a force with an internal state: its stiffness increases with the force, "
            "and more during unloading than during loading (hysteresis, over about "
            f"{quantity(said, unit)})"
        )
    return (
        "a force with an internal state: from each reversal it is elastic over about "
        f"{quantity(said, unit)} and then slips (hysteresis), like a bolted joint or "
        "a wire rope"
    )
