"""Contact intervals of the follower, recorded and simulated."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from rich.table import Table

import jaxcam

from ..hybrid import Trajectory
from ..models import rad_s_to_rpm
from ..recordings import Rig, Segments


# cam turns simulated before the recording begins, so that transients decay
_SETTLE = 20.0


class Intervals(NamedTuple):
    """Contact intervals, each from its start to the release.

    - `begins`, `ends`: cam angle (rad) at the start and end of each, not wrapped.
    - `turns`: number of cam turns examined.
    - `share`: fraction of the time in contact, including intervals truncated by the
      ends of the recording.
    """

    begins: Float[np.ndarray, " k"]
    ends: Float[np.ndarray, " k"]
    turns: float
    share: float


@dataclasses.dataclass(frozen=True)
class Rests:
    """Recorded and simulated contact intervals of one recording."""

    name: str
    rpm: float
    recorded: Intervals
    simulated: Intervals

    def to_json(self) -> dict[str, Any]:
        """Return plain data; cam angles (rad) are wrapped to one turn."""
        return {
            which: {
                "per_turn": len(part.begins) / part.turns,
                "share_of_time": part.share,
                "from": np.mod(part.begins, 2 * math.pi),
                "to": np.mod(part.ends, 2 * math.pi),
            }
            for which, part in self.parts
        }

    @property
    def parts(self) -> tuple[tuple[str, Intervals], ...]:
        return ("recorded", self.recorded), ("simulated", self.simulated)


def simulate_run(rig: Rig, run: Segments) -> Trajectory:
    """Simulate the nominal model at the mean speed of a recording.

    The simulation starts at a release point, twenty cam turns before the recording, and
    ends with the recording.
    """
    assert run.drive is not None
    system = rig.system(run.drive.speed, run.drive.phase)
    begin, end = (float(run.recording.time[i]) for i in (0, -1))
    return jaxcam.simulate(system, None, begin - _SETTLE * float(system.period), end)


def rests(run: Segments, motion: Trajectory) -> Rests:
    """Return the contact intervals of a recording and of its simulation."""
    assert run.drive is not None
    name, rpm = run.recording.name, float(rad_s_to_rpm(run.drive.speed))
    return Rests(name, rpm, _recorded(run), _simulated(run, motion))


def rest_table(found: list[Rests]) -> Table:
    """Return a table with two rows per recording (recorded, simulated)."""
    table = Table(title="Contact intervals of the follower")
    table.add_column("recording", no_wrap=True)
    table.add_column("source")
    for heading in HEADINGS[2:]:
        table.add_column(heading, justify="right")
    for one in found:
        for cells in rest_rows(one):
            table.add_row(*cells)
    return table


HEADINGS = (
    "recording",
    "source",
    "per cycle",
    "from (rad)",
    "to (rad)",
    "fraction of time",
)


def rest_rows(one: Rests) -> list[tuple[str, ...]]:
    """Return the two rows of a recording, with cells in the order of `HEADINGS`."""
    rows = []
    for which, part in one.parts:
        name = one.name if which == "recorded" else ""
        per_turn = f"{len(part.begins) / part.turns:.2f}"
        spans = (_typical(part.begins), _typical(part.ends))
        rows.append((name, which, per_turn, *spans, f"{100 * part.share:.0f} %"))
    return rows


def _recorded(run: Segments) -> Intervals:
    drive, time = run.drive, run.recording.time
    assert drive is not None
    whole = [
        part
        for part in run.contacts
        if part.start.kind == "landing" and part.stop.kind == "release"
    ]
    begins, ends = (
        np.interp(moments, time, drive.angle)
        for moments in (
            [part.settled for part in whole],
            [part.stop.time for part in whole],
        )
    )
    rested = sum(max(0.0, part.stop.time - part.settled) for part in run.contacts)
    turns = abs(drive.angle[-1] - drive.angle[0]) / (2 * math.pi)
    return Intervals(begins, ends, turns, rested / run.recording.duration)


def _simulated(run: Segments, motion: Trajectory) -> Intervals:
    drive, contacts = run.drive, motion.contacts
    assert drive is not None
    first, last = (float(run.recording.time[i]) for i in (0, -1))
    start, end = np.asarray(contacts.start), np.asarray(contacts.end)
    inside = np.clip(end, first, last) - np.clip(start, first, last)
    whole = np.asarray(contacts.released) & (start >= first) & (end > start)
    begins, ends = (drive.speed * t[whole] + drive.phase for t in (start, end))
    turns = drive.speed * (last - first) / (2 * math.pi)
    return Intervals(begins, ends, turns, float(inside.sum()) / (last - first))


def _typical(angle: Float[np.ndarray, " k"]) -> str:
    """Return the mean cam angle within one turn, and the standard deviation."""
    if not len(angle):
        return "-"
    mean = np.mean(np.exp(1j * angle))
    turned = np.mod(angle - np.angle(mean) + math.pi, 2 * math.pi) - math.pi
    middle = (np.angle(mean) + np.mean(turned)) % (2 * math.pi)
    spread = f"{np.std(turned):.2f}"
    # for a periodic motion, the standard deviation is zero and is not shown
    return f"{middle:.2f}" if float(spread) == 0 else f"{middle:.2f} ± {spread}"
