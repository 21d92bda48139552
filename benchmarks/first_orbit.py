"""Measure the first periodic orbit and the first branch in a process, with each
compiler.

The systems have switching surfaces, so that orbits are computed by single shooting.
Every measurement runs in a process of its own, with an empty folder for compiled
programs. The script prints the CPU time in seconds of the first `periodic_orbit` and of
the first `branch`. Importing jax and jaxcam is not included.

    python -m benchmarks.first_orbit
"""

import argparse
import json
import tempfile
import time

import jax.numpy as jnp

import continuation
import jaxcam
from benchmarks._own_process import in_own_process
from jaxcam.hybrid import Settings, SwitchedSystem
from jaxcam.models import BeltOscillator


class BeltWithStop(SwitchedSystem):
    """A forced mass on a belt, with Stribeck friction, in front of a rigid stop."""

    stop: float = 2.148
    belt: float = 1.0

    def switching(self, t, state):
        return state[1] - self.belt

    def branch(self, t, state, sides):
        x, v = state
        friction = 0.4 / (1.0 + 0.2 * sides[0] * (v - self.belt))
        push = 0.9 * jnp.cos(0.7 * t) - sides[0] * friction
        return jnp.stack([v, push - x - 0.1 * v])

    def gap(self, t, state):
        return self.stop - state[0]

    def impact(self, t, state):
        return state.at[1].multiply(-0.6)

    @property
    def period(self):
        return 2 * jnp.pi / 0.7


BELT = BeltOscillator(
    belt=1.3, friction=0.4, weakening=0.0, damping=0.05, amplitude=0.9, omega=0.7
)
# system, parameter of the branch, and its bounds
BRANCHES = {
    "BeltOscillator": (BELT, "belt", (1.0, 1.35)),
    "belt and rigid stop": (BeltWithStop(), "stop", (1.9, 2.15)),
}


def measured(name: str, backend: str) -> tuple[float, float]:
    """CPU seconds of the first orbit, and of the first branch."""
    system, parameter, bounds = BRANCHES[name]
    settings = Settings(tolerance=1e-12, backend=backend)  # pyright: ignore
    run = jaxcam.simulate(system, [0.0, 0.0], 0.0, 60 * float(system.period))
    begun = time.process_time()
    orbit = continuation.periodic_orbit(system, run.final, periods=1, settings=settings)
    found = time.process_time()
    start = continuation.SingleShooting.of(system, orbit, 1, settings)
    continuation.branch(start.problem, start, parameter, bounds, direction=-1)
    return found - begun, time.process_time() - found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--one", nargs=2, metavar=("SYSTEM", "BACKEND"))
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(*options.one)))
        return
    print("| system | backend | first orbit (s) | first branch (s) |")
    print("| --- | --- | --- | --- |")
    for name in BRANCHES:
        for backend in ("xla", "auto"):
            with tempfile.TemporaryDirectory() as folder:
                case = [name, backend]
                orbit, branch = in_own_process("first_orbit", case, folder)
            print(f"| {name} | {backend} | {orbit:.1f} | {branch:.1f} |", flush=True)


if __name__ == "__main__":
    main()
