"""Compare batches on an NVIDIA GPU with the same batches on one core of its machine.

    python -m benchmarks.gpu

Both sides run the same program of the LLVM backend, at a tolerance of 1e-9. Times are
those of whole calls of `stroboscope` after compilation, including all copies of data.
"""

import os
import time

from benchmarks import _timing


_timing.pin()
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import jax.numpy as jnp
import numpy as np
import typer

from jaxcam.hybrid import Settings, stroboscope
from jaxcam.models import (
    BeltOscillator,
    CamFollower,
    ImpactOscillator,
    RockingBlock,
    TwoSidedStop,
)


def _settings(backend: str) -> Settings:
    return Settings(tolerance=1e-9, chatter_depth=1.0, backend=backend)


# a system, the lowest and highest initial states, and the period of the samples if it
# is not that of the forcing
CASES = {
    "CamFollower": (CamFollower(), (0.3, -3.0), (0.8, 3.0), None),
    "ImpactOscillator": (ImpactOscillator(), (-2.0, -1.0), (0.0, 1.0), None),
    "TwoSidedStop": (TwoSidedStop(), (-0.2, -1.0), (0.2, 1.0), None),
    "BeltOscillator": (BeltOscillator(), (-1.0, -1.0), (1.0, 1.0), 6.0),
    "RockingBlock": (RockingBlock(), (-0.1,) * 4, (0.1,) * 4, 2.0),
}


def starts(system, low, high, number: int) -> np.ndarray:
    """Draw admissible initial states, at most `number`."""
    drawn = np.random.default_rng(0).uniform(low, high, (4 * number, len(low)))
    if isinstance(system, RockingBlock):
        drawn[:, 2:] = 0.0

    def least(state):
        gaps = jnp.atleast_1d(system.gap(0.0, state))
        return jnp.min(gaps, initial=1.0)

    return drawn[np.asarray(jax.vmap(least)(drawn)) >= 0][:number]


def measured(call, repeats: int) -> tuple[float, object]:
    """Return the shortest time of a call, and its result."""
    made, best = call(), np.inf
    for _ in range(repeats):
        begun = time.perf_counter()
        made = call()
        best = min(best, time.perf_counter() - begun)
    return best, made


def main(
    trajectories: int = 131072,
    periods: int = 100,
    few: int = 2048,
    repeats: int = 2,
    gpu: bool = True,
) -> None:
    """Run `trajectories` on the GPU, and the first `few` of them on one core."""
    print(f"{'':18} {'one core':>12} {'GPU':>12} {'ratio':>7}  periods/s")
    for name, (system, low, high, period) in CASES.items():
        states = starts(system, low, high, trajectories)

        def run(backend, states, system=system, period=period):
            settings = _settings(backend)
            return lambda: stroboscope(
                system, states, periods, settings=settings, period=period
            )

        slow, by_core = measured(run("llvm", states[:few]), repeats)
        core = len(states[:few]) * periods / slow
        backend = "cuda" if gpu else "llvm"
        fast, by_gpu = measured(run(backend, states), repeats)
        rate = len(states) * periods / fast
        fine = (by_core.code == 0) & (by_gpu.code[:few] == 0)
        error = np.abs(by_gpu.states[:few] - by_core.states)[fine, :3]
        print(
            f"{name:18} {core:12.3g} {rate:12.3g} {rate / core:7.0f}  first three "
            f"periods: {np.max(error, initial=0.0):.0e}; failed "
            f"{np.count_nonzero(by_gpu.code)} of {len(states)}, "
            f"{np.count_nonzero(by_core.code)} of {few} on the core",
            flush=True,
        )


if __name__ == "__main__":
    typer.run(main)
