"""Measure the first simulation in a process, with each compiler.

Every measurement runs in a process of its own: first with an empty folder for compiled
programs, then with the folder that the first process filled. The script prints the CPU
time in seconds of the first `simulate` (3 to 20 s of motion), of the first
`trajectory.at`, and of the same two calls in the second process. Importing jax and
jaxcam is not included.

    python -m benchmarks.first_call
"""

import argparse
import json
import tempfile
import time

import jax
import jax.numpy as jnp
import numpy as np

import jaxcam
from benchmarks._own_process import in_own_process
from jaxcam import models
from jaxcam.hybrid import HybridSystem, Settings


class Table(HybridSystem):
    """An oscillator above a floor, driven by a table of 300 numbers."""

    table: jax.Array

    def vector_field(self, t, state):
        times = jnp.linspace(0.0, 10.0, self.table.shape[0])
        drive = jnp.interp(t, times, self.table)
        return jnp.stack([state[1], drive - state[0]])

    def gap(self, t, state):
        return state[0] + 0.5

    def impact(self, t, state):
        return jnp.stack([state[0], -0.7 * state[1]])


SYSTEMS = {
    "CamFollower": lambda: (models.CamFollower(), [0.35, 0.0], 8.0),
    "ImpactOscillator": lambda: (
        models.ImpactOscillator(omega=2.8, restitution=0.8),
        [-0.5, 0.0],
        20.0,
    ),
    "TwoSidedStop": lambda: (models.TwoSidedStop(), [0.0, 0.1], 20.0),
    "BeltOscillator": lambda: (models.BeltOscillator(), [1.0, 0.0], 20.0),
    "RockingBlock": lambda: (models.RockingBlock(), [0.1, 0.1, 0.0, 0.0], 4.0),
    "SpinningBall": lambda: (
        models.SpinningBall(),
        [0.0, 1.0, 0.0, 1.0, 0.0],
        3.0,
    ),
    "Table": lambda: (Table(jnp.sin(jnp.linspace(0.0, 30.0, 300))), [0.0, 1.0], 9.0),
}


def measured(name: str, backend: str) -> tuple[float, float]:
    """CPU seconds of the first simulation, and of the first samples."""
    system, state, end = SYSTEMS[name]()
    settings = Settings(backend=backend)  # pyright: ignore
    begun = time.process_time()
    run = jaxcam.simulate(system, jnp.asarray(state), 0.0, end, settings=settings)
    simulated = time.process_time()
    run.at(np.linspace(0.0, end, 200))
    assert run.successful, run.result
    return simulated - begun, time.process_time() - simulated


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--one", nargs=2, metavar=("SYSTEM", "BACKEND"))
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(*options.one)))
        return
    print("| system | backend | first simulate, at (s) | in a second process (s) |")
    print("| --- | --- | --- | --- |")
    for name in SYSTEMS:
        for backend in ("xla", "auto"):
            with tempfile.TemporaryDirectory() as folder:
                case = [name, backend]
                times = [in_own_process("first_call", case, folder) for _ in (1, 2)]
            cold, warm = (f"{a:.2f}, {b:.2f}" for a, b in times)
            print(f"| {name} | {backend} | {cold} | {warm} |", flush=True)


if __name__ == "__main__":
    main()
