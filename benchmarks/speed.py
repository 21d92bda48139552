"""Compare the speed of the event loop with scalar numba loops and scipy.

    python -m benchmarks.speed # all parts, one table each

Times are minimum CPU times of interleaved runs on one pinned core in float64, at a
tolerance of 1e-9 on every side. Requires `pip install -e ".[bench]"`.
"""

import subprocess
import sys
import tempfile
import time

from benchmarks import _timing


CORE = _timing.pin()

import jax
import jax.numpy as jnp
import numpy as np
import typer

import jaxcam
from benchmarks import _numba_best, _numba_textbook, _scipy_restart, _workloads
from jaxcam.hybrid import Settings, stroboscope
from jaxcam.models import CamFollower


FAST = Settings(tolerance=1e-9, chatter_depth=1.0, backend="llvm")
BY_XLA = Settings(tolerance=1e-9, chatter_depth=1.0, backend="xla")


def ours(workload, block: int, settings=FAST):
    """A function that runs a workload with jaxcam in one batch call."""
    system = CamFollower(speed=workload.speed[0])
    sweep = {}
    if np.ptp(workload.speed) > 0:
        sweep = {"where": lambda s: s.speed, "values": workload.speed}
    return lambda: stroboscope(
        system, workload.start, workload.turns, settings=settings, block=block, **sweep
    )


def batches(repeats: int, side: int) -> None:
    """Run W1 and W2 with every program, and compare the samples."""
    for workload, block in (
        (_workloads.sweep(), 64),
        (_workloads.grid(side=side), 256),
    ):
        run = ours(workload, block)
        calls = {
            "numba textbook": lambda w=workload: _numba_textbook.simulate(w),
            "numba best, steps": lambda w=workload: _numba_best.simulate(
                w, reach=_numba_best.STEPS_ONLY
            ),
            "numba best": lambda w=workload: _numba_best.simulate(w),
            "jaxcam": run,
            "jaxcam by XLA": ours(workload, block, BY_XLA),
        }
        samples, impacts, _ = calls["numba best"]()
        made = run()
        rows = _timing.compare(
            calls, work=workload.lane_turns, repeats=repeats, reference="numba best"
        )
        print(f"\n{workload.name}: {workload.lane_turns} turns, turns/s")
        print(_timing.table(rows))
        error = np.abs(made.states - samples)[:, :5].max(axis=(1, 2))
        print(
            f"first 5 turns, jaxcam against numba best: median {np.median(error):.1e}, "
            f"90 % {np.quantile(error, 0.9):.1e}; impacts {made.impacts.sum()} against "
            f"{impacts.sum()}; attempts a turn {made.steps.mean() / workload.turns:.1f}"
        )
    lanes = 8
    started = time.process_time()
    _scipy_restart.simulate(_workloads.grid(side=side, turns=8), range(lanes))
    spent = time.process_time() - started
    print(f"scipy restart loop: {lanes * 8 / spent:.0f} turns/s")


def single(repeats: int) -> None:
    """Time one trajectory of 300 turns, and a Jacobian with respect to six
    parameters.
    """
    workload = _workloads.single()
    system = CamFollower(speed=workload.speed[0])
    t1 = workload.turns * float(system.period)
    start = jnp.asarray(workload.start[0])

    def ours(settings=FAST):
        jaxcam.simulate(system, start, 0.0, t1, settings=settings)

    ours(), ours(BY_XLA)
    calls = {
        "numba best, steps": lambda: _numba_best.simulate(
            workload, reach=_numba_best.STEPS_ONLY
        ),
        "jaxcam.simulate": ours,
        "by XLA": lambda: ours(BY_XLA),
    }
    calls["numba best, steps"]()
    rows = _timing.compare(
        calls, work=workload.turns, repeats=repeats, reference="numba best, steps"
    )
    print("\none trajectory of 300 turns at 145 rpm, turns/s")
    print(_timing.table(rows))

    def end(p, steps=1024):
        moved = CamFollower(
            speed=p[0],
            stiffness=p[1],
            inertia=p[2],
            spring_hook_x=p[3],
            spring_elongation=p[4],
            spring_half_height=p[5],
        )
        run = jaxcam.simulate(moved, start, 0.0, 4.0, settings=FAST, max_steps=steps)
        return run.final

    point = jnp.array([workload.speed[0], 105.0, 0.043, -0.031, 0.173, 0.021])
    plain, slope = jax.jit(end), jax.jit(jax.jacfwd(end))
    jax.block_until_ready((plain(point), slope(point)))
    calls = {
        "plain run": lambda: jax.block_until_ready(plain(point)),
        "Jacobian, 6 parameters": lambda: jax.block_until_ready(slope(point)),
    }
    rows = _timing.compare(calls, work=1, repeats=repeats, reference="plain run")
    print("\nforward Jacobian of one trajectory of 10 turns, runs/s")
    print(_timing.table(rows))


_FIRST_CALL = """
import time
import jax
jax.config.update("jax_compilation_cache_dir", {cache!r})
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
import jaxcam
from jaxcam.models import CamFollower
cam = CamFollower()
started = time.perf_counter()
jaxcam.simulate(cam, None, 0.0, 4.0)
print(f"{{time.perf_counter() - started:.2f}}")
"""


def first_call() -> None:
    """Time the first call of `simulate` with a cold and a warm disk cache."""
    with tempfile.TemporaryDirectory() as cache:
        script = _FIRST_CALL.format(cache=cache)
        spent = [
            subprocess.run(
                [sys.executable, "-c", script],
                capture_output=True,
                text=True,
                check=True,
            ).stdout.strip()
            for _ in range(2)
        ]
    print(f"\nfirst call: {spent[0]} s; in a second process: {spent[1]} s")


def main(repeats: int = 3, side: int = 128) -> None:
    """Print all tables; `--side 32` makes W2 smaller."""
    print(f"core {CORE}, jax {jax.__version__}")
    batches(repeats, side)
    single(repeats)
    first_call()


if __name__ == "__main__":
    typer.run(main)
