"""Compare the speed of a user-defined system with that of a scalar numba loop.

    python -m benchmarks.own_system

The system is a forced pendulum leaning on a wall, defined as in the README, with a grid
of initial states. Times are minimum CPU times of interleaved runs on one pinned core,
at a tolerance of 1e-9.
"""

import dataclasses

from benchmarks import _timing


CORE = _timing.pin()

import jax.numpy as jnp
import numpy as np
import typer

import jaxcam
from benchmarks import _numba_own
from jaxcam.hybrid import Settings, stroboscope


SETTINGS = Settings(tolerance=1e-9, chatter_depth=1.0, backend="llvm")


class Pendulum(jaxcam.HybridSystem):
    """A forced pendulum at a wall, in units in which gravity divided by length is
    one.
    """

    wall: float = 0.1  # rad
    restitution: float = 0.75
    damping: float = 0.05
    amplitude: float = 0.8
    frequency: float = 2.0

    @property
    def period(self):
        return 2 * jnp.pi / self.frequency

    def vector_field(self, t, state):
        angle, rate = state
        push = self.amplitude * jnp.cos(self.frequency * t)
        return jnp.stack([rate, -jnp.sin(angle) - self.damping * rate + push])

    def gap(self, t, state):
        return state[0] - self.wall

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


def main(side: int = 48, turns: int = 60, repeats: int = 3) -> None:
    """Simulate `side` x `side` states over `turns` forcing periods."""
    angle, rate = np.meshgrid(np.linspace(0.15, 1.5, side), np.linspace(-1, 1, side))
    start = np.column_stack([angle.ravel(), rate.ravel()])
    system = Pendulum()
    numbers = (0.1, 0.75, 0.05, 0.8, 2.0)

    def ours():
        return stroboscope(system, start, turns, settings=SETTINGS, block=128)

    calls = {
        "numba, order 8": lambda: _numba_own.simulate(start, turns, numbers),
        "jaxcam": ours,
    }
    made, (samples, impacts) = ours(), calls["numba, order 8"]()
    rows = _timing.compare(calls, work=len(start) * turns, repeats=repeats)
    print(
        f"forced pendulum at a wall: {len(start)} trajectories, {turns} periods, "
        f"core {CORE}"
    )
    print(_timing.table(rows))
    by_xla = dataclasses.replace(SETTINGS, backend="xla")
    other = stroboscope(system, start, turns, settings=by_xla, block=128)
    apart = np.abs(made.states - other.states)
    print(
        f"LLVM against XLA: first 5 periods {apart[:, :5].max():.0e}, "
        f"all periods {apart.max():.0e}"
    )
    error = np.abs(made.states - samples)[:, :5].max(axis=(1, 2))
    print(
        f"first 5 turns: median {np.median(error):.1e}, 90 % "
        f"{np.quantile(error, 0.9):.1e}; impacts {made.impacts.sum()} against "
        f"{impacts.sum()}; failed trajectories {int(np.sum(made.code != 0))}; "
        "attempts a turn "
        f"{made.steps.mean() / turns:.1f}"
    )


if __name__ == "__main__":
    typer.run(main)
