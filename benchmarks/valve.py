"""Count the Poincaré returns of a relief valve per second.

    python -m benchmarks.valve # the CPU, one core
    python -m benchmarks.valve --gpu --flows 30720

The relief valve with impacts (coefficient of restitution 0.8) at many flow rates
between 0.2 and 10 is the public benchmark for impacting systems: 1056 returns to the
section where the lift is greatest, for each flow rate, at a tolerance of 1e-10. Here, a
motion instead ends at a given time, long enough for about as many returns, and the
returns are counted.
"""

import os
import time

from benchmarks import _timing


CORE = _timing.pin()
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax.numpy as jnp
import numpy as np
import typer

from benchmarks import _numba_valve
from jaxcam.hybrid import Settings
from jaxcam.hybrid.batch import Chunking, Horizon, Lanes, run_refilled, Table
from jaxcam.hybrid.codes import RowKind
from jaxcam.hybrid.sections import with_section
from jaxcam.models import ReliefValve
from jaxcam.parameters import as_arrays
from jaxcam.sweeps import PoincareSection


# returns per second that others have published for this benchmark
PUBLISHED = {
    "boost odeint, one core of an i7-4820K": 27e3,
    "MPGOS, Titan Black GPU": 4.0e6,
}
START = (0.2, 0.0, 10.0)
KEEP = 32


def _rate_falls(t, state):
    del t
    return state[1]


def returns(flows, duration: float, backend: str):
    """Sample the last returns of each motion."""
    settings = Settings(tolerance=1e-10, chatter_depth=1.0, backend=backend)
    section = PoincareSection(
        ReliefValve(), _rate_falls, -1, period=duration, settings=settings
    )
    start = np.tile(START, (len(flows), 1))
    return section.sample(start, 1, KEEP, where=lambda s: s.flow, values=flows)


def _at_end(record, lane):
    """Store the number of returns at the end of a motion."""
    place = jnp.where(record.kind == float(RowKind.STOP), 0.0, -1.0)
    return place, [lane.points[0]]


def counted(flows, duration: float, backend: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of returns and of attempted steps of each motion."""
    settings = as_arrays(Settings(tolerance=1e-10, chatter_depth=1.0, backend=backend))
    system = as_arrays(with_section(ReliefValve(), _rate_falls, -1, 3))
    lanes = Lanes(
        system, lambda s: s.system.flow, flows, np.tile(START, (len(flows), 1))
    )
    table = Table(_at_end, len(flows), 1, 1)
    when = Horizon(jnp.zeros(()), jnp.asarray(duration), 1)
    _, steps, _ = run_refilled(
        lanes, when, settings, Chunking(128, 64, 1_000_000), table
    )
    return table.numbers[:, 0, 0], steps


def main(
    flows: int = 512,
    duration: float = 2000.0,
    repeats: int = 3,
    gpu: bool = False,
    numba: bool = True,
) -> None:
    """Run `flows` motions of a `duration` (dimensionless time)."""
    backend = "cuda" if gpu else "llvm"
    # in random order, so that threads that work together have equal shares of slow ones
    values = np.random.default_rng(0).permutation(np.linspace(0.2, 10.0, flows))
    begun = time.perf_counter()
    samples = returns(values, duration, backend)
    first = time.perf_counter() - begun
    done = samples.code == 0
    count, steps = counted(values, duration, backend)
    total = int(np.nansum(count))
    print(
        f"relief valve: {flows} flow rates, "
        f"{total / max(1, done.sum()):.0f} returns each, "
        f"{np.count_nonzero(~done)} failed; {steps.sum() / total:.0f} attempted steps "
        f"a return; first call {first:.1f} s"
    )
    best = np.inf
    for _ in range(repeats):
        clock = time.perf_counter if gpu else time.process_time
        begun = clock()
        returns(values, duration, backend)
        best = min(best, clock() - begun)
    where = "one GPU" if gpu else f"core {CORE}"
    print(f"jaxcam, {where}: {total / best:.3g} returns/s")
    for name, rate in PUBLISHED.items():
        print(
            f"published, {name}: {rate:.2g} returns/s; ratio {total / best / rate:.2g}"
        )
    if numba:
        some = values[: min(flows, 64)]
        _numba_valve.simulate(some[:1], 10.0, KEEP)
        begun = time.process_time()
        lifts, count = _numba_valve.simulate(some, duration, KEEP)
        rate = count.sum() / (time.process_time() - begun)
        print(
            f"numba, order 5, core {CORE}: {rate:.3g} returns/s; jaxcam "
            f"{total / best / rate:.2g} times as fast"
        )
        calm = np.ptp(lifts, axis=1) < 1e-6
        ours = samples.states[: len(some), :, 0]
        error = np.abs(ours[calm].mean(axis=1) - lifts[calm].mean(axis=1))
        print(
            f"periodic motions of one return: {calm.sum()} of {len(some)}; largest "
            f"difference of the lift {np.nanmax(error):.1e}"
        )


if __name__ == "__main__":
    typer.run(main)
