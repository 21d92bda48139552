"""Figure 2.13 and eq. (2.43) of the thesis: the bouncing ball, simulated with event
detection and by time-stepping.

The thesis gives the formula, but not the parameters of the ball used here.
"""

from functools import cache
from typing import NamedTuple

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ...hybrid import simulate, Trajectory
from ...models import BouncingBall, CamFollower
from ...plotting.colours import FLIGHT, IMPACT, RECORDED
from ...timestepping import moreau, SteppedMotion
from ..target import Rows, Target


_BALL = BouncingBall(jnp.asarray(9.81), jnp.asarray(0.7))
_LAUNCH = 1.0
# numbers of steps for which errors are averaged, relative to the nominal number
_NEIGHBOURS = (0.92, 0.96, 1.0, 1.04, 1.08)


class Zeno(NamedTuple):
    """The bouncing ball until it comes to rest, simulated with event detection and with
    five step lengths.
    """

    exact: float
    """Accumulation time (thesis, eq. (2.43))."""
    run: Trajectory
    steps: SteppedMotion
    """Time-stepping run with the fewest steps."""
    counts: tuple[int, ...]
    rests: np.ndarray
    """Accumulation time for each number of steps (s)."""


@cache
def zeno() -> Zeno:
    """Simulate the ball once, for both the table and the figure."""
    gravity, r = float(_BALL.gravity), float(_BALL.restitution)
    exact = 2 * _LAUNCH / (gravity * (1 - r))
    start, end = np.array([0.0, _LAUNCH]), 1.2 * exact
    counts = (1000, 2000, 4000, 8000, 16000)
    stepped = [moreau(_BALL, start, 0.0, end, steps) for steps in counts]
    rests = np.array([float(one.rests_from()) for one in stepped])
    run = simulate(_BALL, start, 0.0, end)
    return Zeno(exact, run, stepped[0], counts, rests)


@cache
def errors() -> tuple[np.ndarray, np.ndarray]:
    """Return step lengths (s) and averaged errors of the accumulation time (s).

    The error is a sawtooth function of the positions of the impacts within their steps,
    so it is averaged over neighbouring numbers of steps.
    """
    found = zeno()
    start, end = np.array([0.0, _LAUNCH]), 1.2 * found.exact
    counts = np.outer(found.counts, _NEIGHBOURS).round().astype(int)
    rests = [
        [float(moreau(_BALL, start, 0.0, end, int(n)).rests_from()) for n in row]
        for row in counts
    ]
    return end / counts, np.abs(np.array(rests) - found.exact)


def compute(system: CamFollower) -> Rows:
    del system
    gravity, r = float(_BALL.gravity), float(_BALL.restitution)
    found = zeno()
    rows: Rows = [
        (
            "accumulation time, event detection",
            found.exact,
            found.run.contacts.start[-1],
            "s",
        )
    ]
    for steps, rest in zip(found.counts, found.rests, strict=True):
        rows.append((f"accumulation time, {steps} time steps", found.exact, rest, "s"))
    for n in range(3):
        formula = 2 * _LAUNCH / gravity * sum(r**k for k in range(n + 1))
        rows.append((f"impact {n + 1}", formula, found.run.impacts.time[n], "s"))
    return rows


def draw(system: CamFollower) -> Figure:
    del system
    found = zeno()
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.9))
    times = np.linspace(0.0, float(found.run.t1), 3000)
    axes[0].plot(times, np.asarray(found.run.gap(times)), color=FLIGHT, label="events")
    rough = found.steps
    axes[0].plot(
        np.asarray(rough.time), np.asarray(rough.state)[:, 0], color=IMPACT, ls="--",
        lw=1, label=f"{found.counts[0]} steps",
    )  # fmt: skip
    axes[0].axvline(found.exact, color="0.5", ls=":", lw=1.2)
    axes[0].text(
        found.exact, 0.03, "accumulation ", rotation=90, color="0.3", ha="right",
        va="center",
    )  # fmt: skip
    axes[0].set_xlabel("time (s)")
    axes[0].set_ylabel("height (m)")
    axes[0].legend()
    lengths, error = errors()
    axes[1].loglog(lengths.ravel(), error.ravel(), ".", color=RECORDED, label="single")
    middle, mean = np.mean(lengths, axis=1), np.mean(error, axis=1)
    axes[1].loglog(middle, mean, "o", color=FLIGHT, label="mean of five")
    level = np.exp(np.mean(np.log(mean / middle)))
    axes[1].loglog(middle, level * middle, "--", color="0.6", label="order one")
    # the labels of minor ticks overlap on an axis of less than two decades
    axes[1].xaxis.set_minor_formatter(NullFormatter())
    axes[1].yaxis.set_minor_formatter(NullFormatter())
    axes[1].set_xlabel("step length (s)")
    axes[1].set_ylabel("error of the accumulation time (s)")
    axes[1].legend()
    return figure


TARGET = Target(
    "A bouncing ball, simulated by event detection and by time-stepping", compute, draw
)
