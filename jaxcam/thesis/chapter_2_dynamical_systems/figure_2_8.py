"""Figure 2.8: a saddle, in closed form and numerically, with its multipliers.

The printed figure is a sketch of a flow; the figure drawn here shows the stroboscopic
map of an impact oscillator instead.
"""

from functools import cache
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from variational import Reversed

from ...hybrid import flow
from ...maps import grow_manifold, Saddle, saddle_at
from ...models import CamFollower, ImpactOscillator
from ...plotting.colours import FLIGHT, SECOND
from ..target import Rows, Target


_OMEGA, _RESTITUTION = 2.8, 0.8
"""Forcing frequency and coefficient of restitution of the oscillator of Figure 2.8. The
position of its wall is chosen such that a pair of orbits with one impact per period
exists.
"""
_LENGTH = 0.6


class Strobe(eqx.Module):
    """The stroboscopic map of an impact oscillator."""

    system: ImpactOscillator

    def __call__(self, state):
        return flow(self.system, state, 0.0, self.system.period).state


class BackwardStrobe(eqx.Module):
    """The inverse of the stroboscopic map: the motion in reversed time."""

    system: ImpactOscillator

    def __call__(self, state):
        return flow(Reversed(self.system), state, 0.0, self.system.period).state


class Manifolds(NamedTuple):
    """A saddle of the stroboscopic map, and both sides of its manifolds."""

    saddle: Saddle
    exact: np.ndarray
    """The same saddle from the closed form of orbits with one impact per period."""
    unstable: list[np.ndarray]
    stable: list[np.ndarray]


@cache
def manifolds() -> Manifolds:
    """Return the manifolds of the saddle that a fold of P(1,1) creates.

    For orbits with one impact per period, the speed V before the impact satisfies (k^2
    + m^2) V^2 + 2 k sigma V + sigma^2 - gamma^2 = 0, where sigma is the position of the
    wall and gamma the amplitude of the forced motion (k and m are defined in the code);
    the saddle has the smaller V.
    """
    r, period = _RESTITUTION, 2 * np.pi / _OMEGA
    gamma = 1 / (1 - _OMEGA**2)
    k, m = (1 + r) / np.tan(period / 2) / 2, (1 - r) / (2 * _OMEGA)
    sigma = -np.sign(k) * 0.5 * abs(gamma) * (1 + np.sqrt(1 + (k / m) ** 2))
    roots = np.roots([k**2 + m**2, 2 * k * sigma, sigma**2 - gamma**2])
    speed = float(np.min(roots[roots > 0]))
    phase = np.arctan2(-m * speed / gamma, (sigma + k * speed) / gamma)
    system = ImpactOscillator(*(jnp.asarray(v) for v in (_OMEGA, r, sigma)))
    impact = np.mod(phase / _OMEGA, period)
    exact = flow(system, jnp.array([sigma, -r * speed]), impact, period).state
    strobe = Strobe(system)
    saddle = saddle_at(strobe, exact)
    unstable, stable = (
        [
            grow_manifold(
                forwards,
                saddle.point,
                sign * saddle.directions[:, k],
                length=_LENGTH,
                spacing=0.01,
                start=1e-4,
            )
            for sign in (1, -1)
        ]
        for k, forwards in ((1, strobe), (0, BackwardStrobe(system)))
    )
    return Manifolds(saddle, np.asarray(exact), unstable, stable)


def compute(system: CamFollower) -> Rows:
    del system
    found = manifolds()
    one, other = found.saddle.multipliers
    return [
        ("saddle: position", found.exact[0], found.saddle.point[0], ""),
        ("saddle: velocity", found.exact[1], found.saddle.point[1], ""),
        ("product of the multipliers, r^2", _RESTITUTION**2, one * other, ""),
        ("unstable multiplier", np.nan, other, ""),
        ("points of the unstable manifold", np.nan, sum(map(len, found.unstable)), ""),
        ("points of the stable manifold", np.nan, sum(map(len, found.stable)), ""),
    ]


def draw(system: CamFollower) -> Figure:
    del system
    found = manifolds()
    figure, ax = plt.subplots(figsize=(6.8, 5.0))
    for sides, colour, name in (
        (found.unstable, FLIGHT, "unstable manifold"),
        (found.stable, SECOND, "stable manifold"),
    ):
        for k, side in enumerate(sides):
            ax.plot(*side.T, color=colour, lw=1.3, label=None if k else name)
    point = np.asarray(found.saddle.point)
    ax.plot(*point, "o", color="k", ms=6, label="saddle")
    ax.set_xlabel("position (–)")
    ax.set_ylabel("velocity (–)")
    ax.legend()
    return figure


TARGET = Target("Manifolds of the saddle of an impact oscillator", compute, draw)
