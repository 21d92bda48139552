"""Figure 2.14 (d): a branch of orbits as a function of the belt speed, with its sliding
bifurcations.

The printed figure is a sketch, so the parameters of the oscillator were chosen freely.
"""

from functools import cache
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...filippov.modes import surface_rates
from ...hybrid import simulate, Trajectory
from ...hybrid.record import Switches, SwitchKind
from ...models import BeltOscillator, CamFollower
from ...plotting.colours import CONTACT, FLIGHT, IMPACT
from ..progress import counted
from ..target import Rows, Target


BELT = BeltOscillator(*(jnp.asarray(v) for v in (1.0, 0.4, 0.0, 0.05, 0.9, 0.7)))
"""A forced mass with Coulomb friction on a belt; the belt speed is the parameter."""
_BELTS = np.linspace(0.05, 1.5, 59)
_SETTLE = 30
DRAWN = 0.2, 0.7, 1.1, 1.4
"""Belt speeds of the orbits drawn, one in each interval between events."""


class Belted(NamedTuple):
    """The motion of a mass on a belt at constant speed, over one forcing period."""

    belt: float
    highest: float
    """Largest velocity."""
    stuck: float
    """Fraction of the period spent sticking."""
    crossings: int
    """Number of surface crossings without sticking."""
    run: Trajectory


def belted(belt: float, state=(0.0, 0.0), turns: int = _SETTLE) -> Belted:
    """Return the motion over one forcing period, after `turns` periods of settling."""
    system = eqx.tree_at(lambda s: s.belt, BELT, jnp.asarray(float(belt)))
    period = float(system.period)
    settled = simulate(system, state, 0.0, turns * period).final
    run = simulate(system, settled, 0.0, period)
    held = np.asarray(run.sliding())
    crossed = int(np.sum(np.asarray(_switches(run).kind) == SwitchKind.CROSSES))
    times = np.linspace(0.0, period, 400)
    highest = float(np.max(np.asarray(run.at(jnp.asarray(times)))[:, 1]))
    stuck = float(np.sum(held[:, 1] - held[:, 0])) / period if len(held) else 0.0
    return Belted(float(belt), highest, stuck, crossed, run)


def _switches(run: Trajectory) -> Switches:
    assert run.switches is not None
    return run.switches


@cache
def belt_branch() -> list[Belted]:
    """Compute motions at decreasing belt speeds, each from the final state of the
    previous one.
    """
    made, state = [], (0.0, 0.0)
    for belt in counted("simulating belt speed", _BELTS[::-1]):
        made.append(belted(belt, state))
        state = tuple(np.asarray(made[-1].run.final))
    return made[::-1]


class SlidingEvent(NamedTuple):
    """A belt speed at which the sequence of switches changes."""

    belt: float
    beyond: float
    """Rate of change of the slip velocity along the field beyond the surface, at the
    point where the orbit arrives; zero if that field is tangent to the surface.
    """


def _sticks(one: Belted) -> bool:
    return one.stuck > 0


def _crosses(one: Belted) -> bool:
    return one.crossings > 0


def _between(holds, first: Belted, second: Belted) -> float:
    """Return the belt speed between two motions at which a property is lost, found by
    bisection.
    """
    inside, outside = first.belt, second.belt
    state = tuple(np.asarray(second.run.final))
    for _ in counted("bisecting the belt speed, step", range(24)):
        middle = (inside + outside) / 2
        yes = holds(belted(middle, state))
        inside, outside = (middle, outside) if yes else (inside, middle)
    return (inside + outside) / 2


@cache
def sliding_events() -> dict[str, SlidingEvent]:
    """Return the events of the branch, from a fast belt to a slow one, by bisection.

    Grazing-sliding: the motion touches the surface and begins to slide there.
    Switching-sliding: the motion begins to cross the surface before it slides.
    Crossing-sliding: the other crossing gains, or loses, a sliding segment.
    At the last two events, the field beyond the surface is tangent to the surface.
    """
    branch = belt_branch()
    pairs = list(zip(branch[:-1], branch[1:], strict=True))
    searches = {
        "grazing-sliding": [(_sticks, a, b) for a, b in pairs if _sticks(a)],
        "switching-sliding": [(_crosses, a, b) for a, b in pairs if _crosses(a)],
        "crossing-sliding": [(_sticks, b, a) for a, b in pairs if _sticks(b)],
    }
    found = {}
    for name, search in searches.items():
        changes = [one for one in search if not one[0](one[2])]
        belt = _between(*changes[-1]) if changes else np.nan
        found[name] = SlidingEvent(belt, _rate_beyond(belt, name))
    return found


def _rate_beyond(belt: float, name: str) -> float:
    """Return `SlidingEvent.beyond` for an event; the orbit arrives from below at a
    switching-sliding event and from above at a crossing-sliding event.
    """
    side = {"switching-sliding": -1, "crossing-sliding": 1}.get(name)
    if side is None or not np.isfinite(belt):
        return np.nan
    switches = _switches(belted(belt, turns=2 * _SETTLE).run)
    # find the switch at which the orbit arrives at the surface from the side required
    arrives = np.asarray(switches.kind) != SwitchKind.LEAVES
    from_side = np.asarray(switches.direction) == -side
    k = int(np.flatnonzero(arrives & from_side)[0])
    system = eqx.tree_at(lambda s: s.belt, BELT, jnp.asarray(belt))
    above, below = surface_rates(system, switches.time[k], switches.before[k])
    return float(above if side < 0 else below)


def grazing_in_closed_form() -> float:
    """Return the belt speed that the motion without sticking just reaches.

    Friction is constant while the mass is slower than the belt, so the motion is
    harmonic about a shifted equilibrium.
    """
    omega, damping = float(BELT.omega), float(BELT.damping)
    size = np.hypot(1 - omega**2, 2 * damping * omega)
    return float(BELT.amplitude) * omega / size


def compute(system: CamFollower) -> Rows:
    del system
    events = sliding_events()
    rows: Rows = [
        (
            "grazing-sliding, closed form against simulation",
            grazing_in_closed_form(),
            events["grazing-sliding"].belt,
            "",
        )
    ]
    for name in ("switching-sliding", "crossing-sliding"):
        rows.append((f"{name}: belt", np.nan, events[name].belt, ""))
        words = f"{name}: rate of the field beyond the surface (0: tangent)"
        rows.append((words, 0.0, events[name].beyond, ""))
    for belt in DRAWN:
        one = min(belt_branch(), key=lambda b: abs(b.belt - belt))
        words = f"belt {one.belt:.3g}"
        rows.append(
            (f"{words}: fraction of the period spent sticking", np.nan, one.stuck, "")
        )
        rows.append((f"{words}: crossings per period", np.nan, one.crossings, ""))
    return rows


def draw(system: CamFollower) -> Figure:
    del system
    branch = belt_branch()
    events = sliding_events()
    figure = plt.figure(figsize=(10.5, 6.4))
    grid = figure.add_gridspec(2, 4)
    top = figure.add_subplot(grid[0, :])
    belts = np.array([one.belt for one in branch])
    stuck = np.array([one.stuck for one in branch])
    top.plot(belts, stuck, ".-", color=FLIGHT, ms=5)
    styles = zip(events.items(), (":", "-.", "--"), strict=True)
    for (name, event), dashes in styles:
        top.axvline(event.belt, color=IMPACT, ls=dashes, lw=1.4, label=name)
    top.set_xlabel("belt speed (–)")
    top.set_ylabel("fraction of period sticking (–)")
    top.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
    names = ("crosses", "crosses and sticks", "sticks", "slips")
    drawn = zip(DRAWN, names, strict=True)
    for k, (belt, name) in enumerate(drawn):
        ax = figure.add_subplot(grid[1, k])
        one = min(branch, key=lambda b: abs(b.belt - belt))
        times = np.linspace(float(one.run.t0), float(one.run.t1), 1500)
        states = np.asarray(one.run.at(jnp.asarray(times)))
        ax.plot(*states.T, color=FLIGHT, lw=1.2)
        held = np.zeros(len(times), dtype=bool)
        for start, end in np.asarray(one.run.sliding()):
            held |= (times >= start) & (times <= end)
        shown = np.where(held[:, None], states, np.nan)
        ax.plot(*shown.T, color=CONTACT, lw=3.2)
        ax.axhline(one.belt, color="0.5", ls=":", lw=1)
        ax.set_title(f"{name}, {one.belt:.3g}", fontsize=11)
        ax.set_xlabel("position (–)")
    figure.axes[1].set_ylabel("velocity (–)")
    return figure


TARGET = Target("Sliding bifurcations of a mass on a belt", compute, draw)
