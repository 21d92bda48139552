"""Compare sweeps with the bare event loop: speed, wasted steps, memory, two cores.

    python -m benchmarks.sweeps                      # all parts
    python -m benchmarks.sweeps --side 64 --largest 10000 --no-cluster

The two workloads are those of `benchmarks.speed`. The bare loop is `stroboscope`, one
call for all trajectories; the sweep also labels motions, finds the attractors and
writes to disk. Times are minimum CPU times of interleaved runs on one pinned core (wall
times for the parts on two cores), at a tolerance of 1e-9 on both sides.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks import _timing


# not when another process of these benchmarks imports this module
CORE = _timing.pin() if __name__ == "__main__" else None

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import typer

from benchmarks import _workloads
from jaxcam.hybrid import stroboscope
from jaxcam.hybrid.batch import _refilled_lanes
from jaxcam.models import CamFollower, rpm_to_rad_s
from jaxcam.sweeps import basins, diagram, Grid


def rig() -> CamFollower:
    """The rig of Table 4.4 at 145 rpm."""
    speed = jnp.asarray(rpm_to_rad_s(145.0), dtype=float)
    return eqx.tree_at(lambda s: s.speed, CamFollower(), speed)


def states_at_145(side: int) -> Grid:
    """The states of workload W2 as grid cells."""
    low = _workloads.contact_angle(0.0) + 0.001
    return Grid((low, -3.0), (low + 0.249, 3.0), (side, side))


def swept_to(work):
    """A call of the sweep that writes to a new folder each time."""

    def call():
        with tempfile.TemporaryDirectory() as folder:
            work(Path(folder) / "sweep")

    return call


def kept(repeats: int, side: int) -> None:
    """Print the relative speed of the sweep and the fraction of wasted steps."""
    system, grid, turns = rig(), states_at_145(side), 30
    states, lanes = grid.states(), side * side
    sweep = _workloads.sweep()

    def basin(out):
        basins(system, grid, turns, keep=12, reruns=0, out=out, workers=1)

    def diagram_of(out):
        diagram(
            system, "speed", sweep.speed, sweep.start[:, None], turns=sweep.turns,
            keep=50, out=out, workers=1,
        )  # fmt: skip

    parts = {
        f"basin {side} x {side} x {turns}": (
            lambda: stroboscope(system, states, turns, skip=turns - 12),
            basin,
            lanes * turns,
        ),
        "diagram 256 x 100": (
            lambda: stroboscope(
                system,
                sweep.start,
                sweep.turns,
                skip=50,
                where=lambda s: s.speed,
                values=sweep.speed,
            ),
            diagram_of,
            sweep.lane_turns,
        ),
    }
    for title, (bare, swept, work) in parts.items():
        calls = {"bare loop": bare, "sweep": swept_to(swept)}
        rows = _timing.compare(calls, work=work, repeats=repeats)
        print(f"\n{title}, turns/s")
        print(_timing.table(rows))
        idle = " and ".join(
            f"{idle_slots(call):.1%}" for call in (bare, swept_to(swept))
        )
        print(f"attempts at idle batch positions: {idle}")


def idle_slots(call) -> float:
    """Share of the attempts that the compiled loop made at empty batch positions."""
    slots, steps, compiled = [], [], _refilled_lanes.compiled_chunk

    def counted(start, *others):
        chunk, place = compiled(start, *others), start.slots.rows.steps

        def looking(own, shared, numbers):
            made, log = chunk(own, shared, numbers)
            slots.append(log[0].size)
            steps.append(np.sum(np.asarray(made)[place] - np.asarray(numbers)[place]))
            return made, log

        return looking

    _refilled_lanes.compiled_chunk = counted
    try:
        call()
    finally:
        _refilled_lanes.compiled_chunk = compiled
    return float(1 - np.sum(steps) / np.sum(slots))


_TWO_CORES = """
import os, sys, threading, time
os.sched_setaffinity(0, range(os.cpu_count()))
import numba
from benchmarks.sweeps import rig, states_at_145
from jaxcam.sweeps import basins, cluster
side, repeats, on_cluster = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3] == "True"
@numba.njit(nogil=True)
def spin(number):
    total = 0.0
    for k in range(number):
        total += (k % 7) * 1e-3
    return total
def pairs(one, two):
    one(), two()
    spent = [[], []]
    for _ in range(repeats):
        for work, times in zip((one, two), spent):
            started = time.perf_counter()
            work()
            times.append(time.perf_counter() - started)
    return spent
def threads(number):
    some = [threading.Thread(target=spin, args=(1_000_000_000,)) for _ in range(number)]
    [one.start() for one in some]
    [one.join() for one in some]
def swept(**options):
    grid = states_at_145(side)
    basins(rig(), grid, 30, keep=12, reruns=0, block=side // 4, **options)
def say(what, spent, work=1):
    ratios = [work * a / b for a, b in zip(*spent)]
    best = work * min(spent[0]) / min(spent[1])
    each = ", ".join(f"{ratio:.2f}" for ratio in ratios)
    print(f"{what}: {best:.2f} times one ({each})")
if __name__ == "__main__":
    say("empty loops in two threads", pairs(lambda: threads(1), lambda: threads(2)), 2)
    say("two threads", pairs(lambda: swept(workers=1), lambda: swept(workers=2)))
    if on_cluster:
        with cluster("local", 1) as alone, cluster("local", 2) as both:
            calls = [lambda e=e: swept(executor=e) for e in (alone, both)]
            say("two Dask workers", pairs(*calls))
"""


def two_cores(side: int, repeats: int, on_cluster: bool) -> None:
    """Compare wall times on one and two cores, in a process that is not pinned.

    XLA creates as many threads as it finds cores when it starts. The first line is the
    speed-up of the machine itself; the ratios of the individual pairs of runs are in
    brackets.
    """
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "two_cores.py"
        script.write_text(_TWO_CORES)
        numbers = [str(side), str(repeats), str(on_cluster)]
        found = subprocess.run(
            [sys.executable, str(script), *numbers],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
    print("\n" + found.stdout.rstrip())


_SCALE = """
import resource, sys, time
from benchmarks.sweeps import rig, states_at_145
from jaxcam.sweeps import basins, Grid
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
lanes, folder = int(sys.argv[1]), sys.argv[2]
side = round(lanes ** 0.5)
# compiled, and every library loaded
options = {"keep": 12, "reruns": 0, "workers": 1}
basins(rig(), states_at_145(64), 30, out=folder + "/first", **options)
before, started = peak(), time.perf_counter()
basins(rig(), states_at_145(side), 30, out=folder + "/x", **options)
print(side * side, time.perf_counter() - started, before, peak() - before)
"""


def scale(largest: int) -> None:
    """Print time and memory against the number of initial states, each in a new
    process.
    """
    print("\n   states        s  us a turn  peak before (MB)  and beyond (MB)")
    lanes = 10_000
    while lanes <= largest:
        with tempfile.TemporaryDirectory() as folder:
            found = subprocess.run(
                [sys.executable, "-c", _SCALE, str(lanes), folder],
                capture_output=True,
                text=True,
                check=True,
            ).stdout.split()
        number, seconds, before, beyond = map(float, found[-4:])
        each = seconds / number / 30 * 1e6
        numbers = f"{number:9.0f}  {seconds:7.2f}  {each:9.2f}"
        print(f"{numbers}  {before:16.0f}  {beyond:15.0f}")
        lanes *= 10


def main(
    repeats: int = 3, side: int = 128, largest: int = 100_000, cluster: bool = True
) -> None:
    """Print all tables; `--side 64` makes them smaller, `--largest 1000000` longer."""
    print(f"core {CORE}, jax {jax.__version__}")
    kept(repeats, side)
    two_cores(2 * side, repeats, cluster)
    scale(largest)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"\npeak of this process: {peak:.0f} MB")


if __name__ == "__main__":
    typer.run(main)
