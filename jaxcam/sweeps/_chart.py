"""Compute charts of labels and exponents in the plane of two parameters."""

import functools
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from ..parameters import Pick, pick
from ._chart_result import Chart
from ._exponents import largest_exponents
from ._inputs import as_section, as_starts, as_values, check_regular, check_turns
from .attractors import settle
from .blocks import (
    about_section,
    AbstractJob,
    Arrays,
    digest,
    Progress,
    run_blocks,
    StoredVariable,
    StoreLayout,
)
from .sections import AbstractSection


_LANES = 1024
"""Number of motions in a block, smaller than in other sweeps because exponents take a
long time to compute.
"""


def chart(
    system,
    where: tuple,
    first,
    second,
    states=None,
    *,
    turns: int = 300,
    keep: int = 32,
    period_tolerance: float = 1e-6,
    reruns: int = 0,
    exponents: int = 0,
    out: str | Path | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    block: int | None = None,
) -> Chart:
    """Compute the label of the motion at each pair of values of two parameters.

    Args:
        system: A hybrid system, or a section that is sampled once per period.
        where: Two parameters: `("speed", "stiffness")`, or two functions.
        first: Values of the first parameter, shape `(k,)`.
        second: Values of the second parameter, shape `(l,)`.
        states: Initial states, `(n,)` or `(starts, n)`; default: a state in
            sustained contact.
        turns: As for [`jaxcam.sweeps.basins`][].
        keep: As for [`jaxcam.sweeps.basins`][].
        period_tolerance: As for [`jaxcam.sweeps.basins`][].
        reruns: As for [`jaxcam.sweeps.basins`][].
        exponents: Number of additional periods for the largest Lyapunov exponent; 0 to
            omit it.
        out: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        resume: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        executor: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        workers: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        progress: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        block: Number of values of the second parameter computed together.

    Returns:
        A [`jaxcam.sweeps.Chart`][].

    Raises:
        ValueError: An argument is invalid; the message says how to fix it.
        RuntimeError: Workers were lost.

    Examples:
        >>> from jaxcam import sweeps
        >>> f = lambda x, p: p["a"] + p["b"] * x - x**2
        >>> quadratic = sweeps.Map(f, {"a": 0.0, "b": 0.5})
        >>> found = sweeps.chart(quadratic, ("a", "b"), [0.0, 0.1], [0.4, 0.5], [0.1])
        >>> found.labels.shape
        (2, 2, 1)
    """
    section = as_section(system)
    check_turns(turns, keep, period_tolerance, reruns)
    check_regular(section, "a chart needs")
    if not isinstance(where, tuple) or len(where) != 2:
        raise ValueError("where must be a tuple of two parameters: (one, other)")
    if exponents and exponents < 16:
        raise ValueError(
            f"exponents is {exponents}; give at least 16 periods, or 0 for none"
        )
    if block is not None and block < 1:
        raise ValueError(f"block is {block}; give 1 or more values")
    picked = pick(where, section.system)
    first, second = as_values(first), as_values(second)
    job = ChartJob(
        section, picked, first, second, states, turns, keep, period_tolerance, reruns,
        exponents, block,
    )  # fmt: skip
    store = run_blocks(
        job,
        out=out,
        resume=resume,
        executor=executor,
        workers=workers,
        progress=progress,
    )
    return Chart(store.dataset())


class ChartJob(AbstractJob):
    """Computes the motions for some values of the second parameter, and for all values
    of the first, in each block.
    """

    def __init__(
        self,
        section: AbstractSection,
        where: Pick,
        first: np.ndarray,
        second: np.ndarray,
        states,
        turns: int,
        keep: int,
        period_tolerance: float,
        reruns: int,
        exponents: int,
        block: int | None,
    ):
        self.section, self.where = section, where
        self.first, self.second = first, second
        self.starts = as_starts(section, states, where, self._pairs(0, len(second)))
        self.settings = (turns, keep, period_tolerance, reruns, exponents)
        count = self.starts.shape[1]
        x, y = (name.replace(".", "_") for name in where.names)
        tail, dims = (len(first), count), (y, x, "start")
        variables = {
            "impacts": StoredVariable(dims, tail, "int32"),
            "turns": StoredVariable(dims, tail, "int32"),
            "code": StoredVariable(dims, tail, "int32"),
        }
        if exponents:
            about = {"units": "1/s", "about": "largest Lyapunov exponent"}
            variables["exponent"] = StoredVariable(dims, tail, "float64", about)
            variables["exponent_stderr"] = StoredVariable(dims, tail, "float64", about)
        rows = max(1, _LANES // (len(first) * count)) if block is None else block
        rows = min(rows, len(second))
        identity = {
            "sweep": "chart",
            **about_section(section),
            "where": list(where.names),
            "first": digest(first),
            "second": digest(second),
            "starts": digest(self.starts),
            "turns": turns,
            "keep": keep,
            "period_tolerance": period_tolerance,
            "reruns": reruns,
            "exponents": exponents,
            "block": rows,
        }
        coordinates = {
            x: (x, first, {"role": "first"}),
            y: (y, second, {"role": "second"}),
        }
        self.layout = StoreLayout(len(second), rows, variables, coordinates, identity)

    def work(self, block: int, before: Arrays | None) -> Callable[[], Arrays]:
        del before
        low, high = self.layout.bounds(block)
        k = len(self.first)
        return functools.partial(
            some_pairs,
            self.section,
            self.where,
            self._pairs(low, high),
            self.starts[low * k : high * k],
            (high - low, k),
            *self.settings,
        )

    def _pairs(self, low: int, high: int) -> np.ndarray:
        y, x = np.meshgrid(self.second[low:high], self.first, indexing="ij")
        return np.stack([x.ravel(), y.ravel()], axis=1)


def some_pairs(
    section, where, pairs, starts, shape, turns, keep, period_tolerance, reruns,
    exponents,
) -> Arrays:  # fmt: skip
    """Compute labels (and exponents if requested) for some pairs of values."""
    count, n = starts.shape[1:]
    values = np.repeat(pairs, count, axis=0)
    samples, labels = settle(
        section,
        starts.reshape(-1, n),
        turns,
        keep,
        period_tolerance=period_tolerance,
        reruns=reruns,
        where=where,
        values=values,
    )
    found = {
        "impacts": labels.impacts,
        "turns": labels.turns,
        "code": samples.code,
    }
    if exponents:
        made = largest_exponents(
            section, samples.final, exponents, where=where, values=values
        )
        found |= {"exponent": made.largest, "exponent_stderr": made.stderr}
    return {name: array.reshape(*shape, count) for name, array in found.items()}
