"""Compare the speed of batches with switching surfaces with that of the cam-follower.

    python -m benchmarks.switching --lanes 512 --turns 40

Each system is simulated in one batch of `stroboscope`, from random states, on one
pinned core. The table gives the CPU time of an attempted step, and the attempted steps
per second relative to those of the cam-follower; times are minima of interleaved runs.
"""

from benchmarks import _timing


CORE = _timing.pin() if __name__ == "__main__" else None

import numpy as np
import typer

import jaxcam
from jaxcam.hybrid import stroboscope
from jaxcam.models import (
    BeltOscillator,
    CamFollower,
    DryFrictionOscillator,
    GearBacklash,
    SpringMassRunner,
)


def batches(lanes: int) -> dict:
    """For each name, a system, its initial states and the length of a turn (s)."""
    rng = np.random.default_rng(28)
    rig = CamFollower()
    above = np.asarray(jaxcam.simulate(rig, None, 0.0, 5.0).final)
    follower = above + rng.uniform([0.05, -0.5], [0.07, 0.5], (lanes, 2))
    plane = rng.uniform([-2.0, -1.0], [2.0, 1.0], (lanes, 2))
    runner = np.array([0.0, 1.0, 5.0, 0.0])
    spread = rng.uniform(-0.02, 0.02, (lanes, 1)) * np.array([0.0, 1.0, 5.0, 0.0])
    return {
        "CamFollower": (rig, follower, None),
        "GearBacklash (two surfaces)": (
            GearBacklash(load=0.1, damping=0.05, amplitude=0.3, omega=0.9),
            plane,
            None,
        ),
        "DryFrictionOscillator (sticking)": (
            DryFrictionOscillator(omega=0.5, friction=0.6),
            plane,
            None,
        ),
        "BeltOscillator (sticking)": (
            BeltOscillator(
                belt=1.0,
                friction=0.4,
                weakening=0.5,
                damping=0.05,
                amplitude=0.9,
                omega=0.7,
            ),
            plane,
            None,
        ),
        "SpringMassRunner (four modes)": (SpringMassRunner(), runner + spread, 0.35),
    }


def main(lanes: int = 512, turns: int = 40, repeats: int = 5) -> None:
    calls, steps = {}, {}
    for name, (system, states, length) in batches(lanes).items():

        def call(system=system, states=states, length=length):
            return stroboscope(system, states, turns, period=length)

        seen = call()
        failed = int(np.sum(np.asarray(seen.code) != 0))
        if failed:
            raise RuntimeError(f"{failed} motions of {name} stopped early")
        calls[name], steps[name] = call, int(np.sum(np.asarray(seen.steps)))
    print(f"{lanes} motions of {turns} turns each")
    for row in _timing.compare(calls, steps, repeats):
        nano = 1e9 * row.seconds / steps[row.name]
        print(
            f"{row.name:34} {nano:6.0f} ns per attempted step, "
            f"{row.ratio:5.2f} times the speed of the cam-follower"
        )


if __name__ == "__main__":
    typer.run(main)
