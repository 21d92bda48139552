"""Compare the speed of Lyapunov spectra with that of a scalar numba loop.

    python -m benchmarks.lyapunov                 # 1000 values, 2000 turns
    python -m benchmarks.lyapunov --lanes 128 --turns 200

The system is the damped forced oscillator with about one impact per period, at
frequencies between 3.2 and 3.9 (orbits with one impact, and chaos). Times are minimum
CPU times of interleaved runs on one pinned core, at a tolerance of 1e-9 on both sides.
Requires `pip install -e ".[bench]"`.
"""

from benchmarks import _timing


CORE = _timing.pin()

import jax
import numpy as np
import typer

import variational
from benchmarks import _numba_lyapunov
from jaxcam.hybrid import Settings
from jaxcam.models import ImpactOscillator


R, WALL, DAMPING, START = 0.8, -0.2, 0.02, (-0.9, 0.0)
FAST = Settings(tolerance=1e-9, chatter_depth=1.0)


def main(lanes: int = 1000, turns: int = 2000, repeats: int = 3) -> None:
    """Print the speeds of both programs, and the agreement of their exponents."""
    omega = np.linspace(3.2, 3.9, lanes)
    system = ImpactOscillator(restitution=R, wall=WALL, damping=DAMPING)

    def ours():
        return variational.lyapunov_spectrum(
            system,
            START,
            turns,
            transient=0,
            where=lambda s: s.omega,
            values=omega,
            settings=FAST,
        )

    def theirs():
        return _numba_lyapunov.spectra(omega, R, WALL, DAMPING, START, turns)

    made, (exponents, hits) = ours(), theirs()
    rate = np.asarray(made.impact_rate * made.turn * turns)
    calls = {"numba loop": theirs, "variational": ours}
    rows = _timing.compare(
        calls, work=int(hits.sum()), repeats=repeats, reference="numba loop"
    )
    print(
        f"core {CORE}, jax {jax.__version__}; {lanes} trajectories, {turns} periods, "
        "impacts/s"
    )
    print(_timing.table(rows))
    calm = exponents[:, 0] < 0
    gone = np.abs(np.asarray(made.exponents) - exponents).max(axis=1)[calm]
    rule = -2 * DAMPING + 2 * np.log(R) * np.asarray(made.impact_rate)
    sums = np.asarray(made.exponents).sum(axis=1)
    # a chaotic motion may come to rest on the wall, which the numba loop does not
    # handle
    free = np.isfinite(sums)
    print(
        f"impacts a turn {hits.sum() / lanes / turns:.2f} ({rate.sum():.0f} against "
        f"{hits.sum()}); exponents that are negative differ by {np.median(gone):.1e} "
        f"(median); "
        f"sum rule missed by {np.abs(sums - rule)[free].max():.1e}, "
        f"{np.sum(~free)} trajectories that stick are omitted; "
        f"{np.mean(np.asarray(made.exponents)[:, 0] > 0.01):.0%} chaotic"
    )


if __name__ == "__main__":
    typer.run(main)
