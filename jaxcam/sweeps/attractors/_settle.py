"""Run motions until they repeat, or up to a time limit."""

from collections.abc import Callable

import numpy as np

from ...parameters import pick
from ..sections import AbstractSection, Samples, with_lanes
from ._label import APERIODIC, label, Labels


def settle(
    section: AbstractSection,
    states,
    turns: int,
    keep: int,
    *,
    period_tolerance: float = 1e-6,
    reruns: int = 0,
    where=None,
    values=None,
    progress: Callable[[float], None] | None = None,
) -> tuple[Samples, Labels]:
    """Sample motions and label them, and extend the runs of those that are not
    periodic.

    Args:
        section: The section.
        states: Initial states, shape `(motions, n)`.
        turns: Number of periods.
        keep: Number of samples to keep.
        period_tolerance: Tolerance for detecting periods.
        reruns: Number of extensions of non-periodic runs, each twice as long as the
            previous one.
        where: Selects one or more parameters.
        values: Value of the parameter in each motion.
        progress: Called with the fraction of periods completed.

    Returns:
        Samples and labels.

    Examples:
        >>> from jaxcam import sweeps
        >>> from jaxcam.sweeps.attractors import settle
        >>> logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
        >>> starts, mu = np.full((3, 1), 0.3), [2.8, 3.2, 3.9]
        >>> _, labels = settle(logistic, starts, 200, 16, where="mu", values=mu)
        >>> labels.turns.tolist()  # stable up to 3, period 2 up to 3.449, chaos at 3.9
        [1, 2, 0]
    """
    where = None if where is None else pick(where, section.system)
    values = None if values is None else np.asarray(values, dtype=float)
    samples = section.sample(states, turns, keep, where=where, values=values)
    report = progress or (lambda share: None)
    done, total = turns, turns * (2 ** (reruns + 1) - 1)
    report(done / total)
    counted = section.impacting and section.regular
    sizes = section.sizes(states, samples, where, values)
    labels = label(samples, period_tolerance, counted, sizes)
    for _ in range(reruns):
        turns *= 2
        (open_,) = np.nonzero(labels.turns == APERIODIC)
        if not len(open_):
            break
        some = None if values is None else values[open_]
        start = samples.final[open_]
        again = section.sample(start, turns, keep, where=where, values=some)
        done += turns
        report(done / total)
        samples = with_lanes(samples, open_, again)
        labels = label(samples, period_tolerance, counted, sizes)
    return samples, labels
