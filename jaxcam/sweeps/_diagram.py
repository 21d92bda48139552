"""Compute bifurcation diagrams by brute force."""

from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import Literal

import numpy as np

from ..parameters import pick
from ._diagram_job import DiagramJob
from ._diagram_result import Diagram
from ._dwell import dwell_turns
from ._inputs import as_section, as_starts, as_values, check_turns
from .blocks import Progress, run_blocks
from .sections import BEHIND


Direction = Literal["each", "up", "down", "both"]
_DIRECTIONS = ("each", "up", "down", "both")


def diagram(
    system,
    where: Callable | str,
    values,
    states=None,
    *,
    turns: int = 300,
    keep: int = 100,
    direction: Direction = "each",
    dwell: tuple[float, float] | None = None,
    period_tolerance: float = 1e-6,
    out: str | Path | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    block: int | None = None,
) -> Diagram:
    """Compute a bifurcation diagram: steady-state motions against a parameter.

    Args:
        system: A hybrid system, sampled once per period, or a section such as
            [`jaxcam.sweeps.ImpactSection`][] or [`jaxcam.sweeps.Map`][].
        where: The parameter: `lambda s: s.speed`, or `"speed"`.
        values: Values of the parameter, shape `(points,)`.
        states: Initial states: `(n,)`; `(starts, n)` for several at each value;
            `(points, starts, n)` for different ones at each value, for example from
            [`jaxcam.sweeps.monte_carlo`][]. Default: a state in sustained contact.
        turns: Number of periods simulated.
        keep: Number of final periods to keep.
        direction: With "each", the motions at all values start from the same state.
            With "up", "down" or "both", each motion starts from the final state of the
            motion at the previous value, so that hysteresis becomes visible.
        dwell: Settling time and recording time (s) at each value, instead of `turns`
            and `keep`.
        period_tolerance: Tolerance for detecting periods.
        out: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        resume: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        executor: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        workers: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        progress: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        block: Number of values computed and stored together.

    Returns:
        A [`jaxcam.sweeps.Diagram`][].

    Raises:
        ValueError: An argument is invalid; the message says how to fix it.
        RuntimeError: Workers were lost.

    Examples:
        >>> from jaxcam import sweeps
        >>> logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
        >>> found = sweeps.diagram(logistic, "mu", [2.8, 3.2], [0.3], keep=16)
        >>> found.states.shape
        (2, 1, 16, 1)
    """
    section = as_section(system)
    check_turns(turns, keep, period_tolerance)
    if direction not in _DIRECTIONS:
        raise ValueError(
            f"direction is {direction!r}; choose one of {', '.join(_DIRECTIONS)}"
        )
    if block is not None and block < 1:
        raise ValueError(f"block is {block}; give 1 or more values")
    picked = pick(where, section.system)
    if picked.several:
        raise ValueError(
            "a diagram has one parameter; use chart for two, or select one of them"
        )
    values = as_values(values)
    many, kept = turns, keep
    if dwell is not None:
        if direction == "each":
            raise ValueError(
                "dwell requires that the state is carried from value to value; choose "
                "the direction up, down or both"
            )
        many, kept = dwell_turns(section, picked, values, dwell)
    starts = as_starts(section, states, picked, values)
    job = DiagramJob(
        section, picked, values, starts, many, kept, direction, period_tolerance,
        block, dwell,
    )  # fmt: skip
    store = run_blocks(
        job,
        out=out,
        resume=resume,
        executor=executor,
        workers=workers,
        progress=progress,
    )
    made = Diagram(store.dataset())
    if np.all(made.dataset["code"].values == BEHIND):
        raise ValueError(
            "all states violate gap >= 0; choose states with every gap at zero or above"
        )
    return made
