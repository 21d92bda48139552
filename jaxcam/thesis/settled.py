"""Compute settled motions of the rig, and compare their labels with printed ones."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..hybrid import simulate, Trajectory
from ..models import CamFollower, rpm_to_rad_s
from ..sweeps import Stroboscopic
from ..sweeps.attractors import CONTACT, label_name, settle, STICKING
from .progress import of_share
from .remember import remembered
from .speeds import at_rpm, speed_of
from .target import Rows


_TURNS, _KEEP, _RERUNS = 300, 64, 2
"""Cycles before the first check, samples kept, and number of extensions."""


class ShownMotion(NamedTuple):
    """A motion shown in the thesis: its start and its printed label."""

    rpm: float
    state: tuple[float, float] | None
    """State at time zero; None is contact at rest."""
    impacts: float
    """Impacts m of the printed label P(m, n); zero means permanent contact."""
    turns: int
    """Periods n of the printed label P(m, n); zero means chaos."""
    name: str = ""

    @property
    def title(self) -> str:
        """The speed, and the letter of the start, if any."""
        return f"{self.name + ', ' if self.name else ''}{self.rpm:g} rpm"


class SettledMotion(NamedTuple):
    """A motion after its transient, with its label."""

    case: ShownMotion
    impacts: int
    """Number of impacts, as in `jaxcam.sweeps.attractors.Labels`."""
    turns: int
    """Number of turns, as in `jaxcam.sweeps.attractors.Labels`."""
    rests: int
    """Number of contact intervals in one orbit, or in all the turns kept."""
    state: Float[np.ndarray, " 2"]
    """Final state, at time zero of its turn."""

    @property
    def label(self) -> str:
        """The label as text."""
        return label_name(self.impacts, self.turns)


@remembered
def settled(system: CamFollower, cases: tuple[ShownMotion, ...]) -> list[SettledMotion]:
    """Simulate the cases until the motions repeat, for at most 2100 turns."""
    section = Stroboscopic(system)
    speeds = np.asarray(rpm_to_rad_s(np.array([case.rpm for case in cases])))
    states = np.array(section.starts(speed_of, speeds))
    for k, case in enumerate(cases):
        if case.state is not None:
            states[k] = case.state
    samples, labels = settle(
        section,
        states,
        _TURNS,
        _KEEP,
        reruns=_RERUNS,
        where=speed_of,
        values=speeds,
        progress=of_share(f"simulating {len(cases)} motions until they settle"),
    )
    return [
        SettledMotion(
            case,
            int(labels.impacts[k]),
            int(labels.turns[k]),
            int(samples.rests[k, -(int(labels.turns[k]) or _KEEP) :].sum()),
            samples.final[k],
        )
        for k, case in enumerate(cases)
    ]


def run_of(system: CamFollower, motion: SettledMotion, turns: float) -> Trajectory:
    """Simulate the settled motion over some turns from time zero."""
    rig = at_rpm(system, motion.case.rpm)
    touching = motion.impacts == CONTACT
    state = None if touching else jnp.asarray(motion.state)
    return simulate(rig, state, 0.0, turns * float(rig.period))


def motion_rows(found: Sequence[SettledMotion]) -> Rows:
    """Return rows that compare the computed labels with the printed ones."""
    rows: Rows = []
    for motion in found:
        case, at = motion.case, motion.case.title
        if case.turns == 0:
            words = f"{at}: period of the orbit in turns (0: aperiodic)"
            rows.append((words, 0, motion.turns, ""))
            continue
        rows.append(
            (f"{at}: period of the orbit in turns", case.turns, motion.turns, "")
        )
        if case.impacts == np.inf:
            rows.append(
                (f"{at}: contact intervals of the orbit", case.turns, motion.rests, "")
            )
        else:
            count = {STICKING: np.inf, CONTACT: 0}.get(motion.impacts, motion.impacts)
            count = count if motion.turns > 0 else np.nan
            rows.append((f"{at}: impacts of the orbit", case.impacts, count, ""))
    return rows
