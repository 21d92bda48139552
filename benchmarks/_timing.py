"""Time several callables: one pinned core, interleaved runs, minimum CPU time.

Other work on the machine can only add time, so the minimum over interleaved runs is the
most stable estimate. CPU time counts every thread of the process; on one pinned core a
program gains nothing from threads.
"""

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """One row: minimum CPU seconds, work per second, and speed relative to the
    reference.
    """

    name: str
    seconds: float
    rate: float
    ratio: float


def pin(core: int | None = None) -> int:
    """Pin every thread of this process to one core (the last allowed by default).

    Best called before jax, numpy or numba start their threads; returns the core.
    """
    core = max(os.sched_getaffinity(0)) if core is None else core
    for thread in os.listdir("/proc/self/task"):
        os.sched_setaffinity(int(thread), {core})
    return core


def compare(
    calls: Mapping[str, Callable[[], object]],
    work: float | Mapping[str, float] = 1.0,
    repeats: int = 5,
    reference: str | None = None,
    clock: Callable[[], float] = time.process_time,
) -> list[Timing]:
    """Time the calls in turn, for `repeats` rounds after a warm-up round.

    `work` is the amount of work in one call (turns, for example): one number, or one
    per name. Ratios are rates relative to that of `reference`, by default the first
    name. A call must return only when its result is ready. Raises ValueError if there
    is nothing to time.
    """
    if not calls or repeats < 1:
        raise ValueError("give at least one callable and at least one repeat")
    best = dict.fromkeys(calls, float("inf"))
    for call in calls.values():
        call()
    for _ in range(repeats):
        for name, call in calls.items():
            start = clock()
            call()
            best[name] = min(best[name], clock() - start)
    amount = work if isinstance(work, Mapping) else dict.fromkeys(calls, work)
    rate = {name: amount[name] / best[name] for name in calls}
    base = rate[next(iter(calls)) if reference is None else reference]
    return [Timing(n, best[n], rate[n], rate[n] / base) for n in calls]


def table(rows: list[Timing], unit: str = "turns") -> str:
    """The rows as text, one per line."""
    width = max(len(row.name) for row in rows)
    lines = [f"{'':{width}}  {'ms':>10}  {unit + '/s':>12}  {'ratio':>8}"]
    for row in rows:
        numbers = f"{row.seconds * 1e3:10.2f}  {row.rate:12.4g}  {row.ratio:8.3g}"
        lines.append(f"{row.name:{width}}  {numbers}")
    return "\n".join(lines)
