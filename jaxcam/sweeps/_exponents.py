"""Compute largest Lyapunov exponents, to distinguish chaos from long transients."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import variational

from ..hybrid import HybridSystem, Settings
from .attractors import unique_rows
from .sections import AbstractSection


class Exponents(NamedTuple):
    """Largest Lyapunov exponents (1/s) and their standard errors."""

    largest: np.ndarray
    """Largest exponent of each motion (1/s), shape `(motions,)`."""
    stderr: np.ndarray
    """Standard error of each exponent (1/s), shape `(motions,)`."""

    @property
    def chaotic(self) -> np.ndarray:
        """Return whether the exponent exceeds zero by three standard errors or more."""
        return self.largest > 3 * self.stderr


def largest_exponents(
    section: AbstractSection,
    states,
    turns: int,
    *,
    where=None,
    values=None,
    progress: Callable[[float], None] | None = None,
) -> Exponents:
    """Compute the largest Lyapunov exponents of motions in steady state.

    Args:
        section: The section, as for [`jaxcam.sweeps.diagram`][].
        states: States after the decay of transients, shape `(motions, n)`; NaN rows
            give NaN.
        turns: Number of periods to average over, at least 16.
        where: As for [`jaxcam.sweeps.sections.AbstractSection`][]; motions with the
            same second parameter are computed together.
        values: As for [`jaxcam.sweeps.sections.AbstractSection`][].
        progress: Called with the completed fraction.

    Returns:
        An `Exponents`.

    Raises:
        ValueError: The section is a map, for which exponents are not available.

    Examples:
        >>> from jaxcam import sweeps
        >>> from jaxcam.models import ImpactOscillator
        >>> section = sweeps.Stroboscopic(ImpactOscillator(omega=2.8, wall=-0.5))
        >>> states = jnp.array([[-0.8, 1.0]])
        >>> sweeps.largest_exponents(section, states, 16).largest.shape
        (1,)
    """
    system = section.system
    if not isinstance(system, HybridSystem):
        raise ValueError(
            "Lyapunov exponents are computed only for hybrid systems; omit them for a "
            "map"
        )
    states = np.asarray(states, dtype=float)
    lanes = len(states)
    made = Exponents(np.full(lanes, np.nan), np.full(lanes, np.nan))
    (ready,) = np.nonzero(np.all(np.isfinite(states), axis=1))
    if not len(ready):
        return made
    values = None if values is None else np.asarray(values, dtype=float)[ready]
    done = 0
    for some, own, one, column in _together(system, where, values, len(ready)):
        part = None
        if progress is not None:
            begun, size = done / len(ready), len(some) / len(ready)
            part = partial(_within, progress, begun, size)
        spectrum = variational.lyapunov_spectrum(
            own,
            states[ready[some]],
            turns,
            t0=float(getattr(section, "t0", 0.0)),
            transient=0,
            turn=getattr(section, "period", None),
            where=one,
            values=column,
            settings=Settings(tolerance=1e-10, chatter_depth=1.0),
            progress=part,
        )
        done += len(some)
        made.largest[ready[some]] = np.asarray(spectrum.exponents)[:, 0]
        made.stderr[ready[some]] = np.asarray(spectrum.stderr)[:, 0]
    return made


def _within(progress, begun: float, size: float, share: float) -> None:
    progress(begun + size * share)


def _together(system, where, values, lanes):
    """Yield the groups of motions that are computed together: the indices of the
    motions, their system, the parameter that varies among them, and its values.
    """
    everybody = np.arange(lanes)
    if where is None:
        yield everybody, system, None, None
        return
    if not isinstance(where(system), tuple):
        yield everybody, system, where, values
        return
    rows, back = unique_rows(values[:, 1:])
    for k, row in enumerate(rows):
        (some,) = np.nonzero(back == k)
        parts = tuple(map(jnp.asarray, (values[some[0], 0], *row)))
        own = eqx.tree_at(where, system, parts)
        yield some, own, lambda s: where(s)[0], values[some, 0]
