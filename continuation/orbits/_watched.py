"""Monitors of orbits with impacts: gaps in flights and speeds of impacts."""

import functools
from typing import Literal, NamedTuple

from .._monitor import Monitor


INTERRUPTION = "interruption of chatter"
"""Kind of the special point at which chatter is complete exactly at release."""


STICKS = "sticks"
"""First word of the signature of orbits that stick."""


class Watched(NamedTuple):
    """A monitored quantity: the lowest gap in a flight, or the approach speed of an
    impact.
    """

    what: Literal["gap", "speed"]
    number: int
    """Number k of the impact, or of the impact that begins the flight."""

    @property
    def name(self) -> str:
        """The name of the monitor."""
        kind = "gap of flight" if self.what == "gap" else "speed of impact"
        return f"{kind} {self.number}"


def watched_of(impacts: int) -> dict[str, Watched]:
    """Return all monitors of an orbit with this number of impacts, by name.

    Their order is that of `gap_or_speed`: gaps first.
    """
    gaps = [Watched("gap", k) for k in range(max(impacts, 1))]
    speeds = [Watched("speed", k) for k in range(impacts)]
    return {one.name: one for one in (*gaps, *speeds)}


@functools.cache
def monitors_of(impacts: int) -> dict[str, Monitor]:
    """Return the monitors of an orbit with this number of impacts, by name."""

    def monitor(one: Watched) -> Monitor:
        if one.what == "gap":
            return Monitor("grazing", ends=True)
        # where an impact has zero speed, the gaps of the adjacent flights are zero too
        beside = ((one.number - 1) % impacts, one.number)
        names = tuple(Watched("gap", k).name for k in beside)
        return Monitor("grazing", ends=True, vanishing=names)

    return {name: monitor(one) for name, one in watched_of(impacts).items()}
