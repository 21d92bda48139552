"""Allow for impacts near the ends of a recording, and for impacts before it began."""

import dataclasses

import numpy as np

from ._contact_stretches import LOW, SHORTEST_FLIGHT, Span
from ._kinks import WINDOW
from ._motion import Motion
from ._segments import Contact, Flight


# Number of samples used to extrapolate a flight
_LEAST = 12


def clear_of_end(motion: Motion, span: Span) -> Span:
    """Return the part of a flight that is certainly before an impact at the end of the
    recording, and after one at its beginning. So close to an end, an impact affects too
    few samples to be detected, but it can be predicted by extrapolating the flight.
    """
    first, last = span
    count = len(motion.time)
    tail = max(SHORTEST_FLIGHT + 1, round(WINDOW / motion.interval))
    if last - first < tail + _LEAST:
        return span
    if last == count:
        fit = motion.fit(first, last - tail, at_end=True)
        rows = np.arange(last - tail, last)
        down = _near(motion, fit, rows)
        last = int(rows[np.argmax(down)]) if np.any(down) else last
    if first == 0:
        fit = motion.fit(tail, last, at_end=False)
        rows = np.arange(tail)
        down = _near(motion, fit, rows)
        first = int(rows[down][-1]) + 1 if np.any(down) else first
    return first, last


def _near(motion: Motion, fit, rows):
    """Return whether the extrapolated flight is near the surface at each of these
    samples.
    """
    heights = np.array([fit.value(time) for time in motion.time[rows]])
    return heights - motion.contact[rows] < LOW * motion.noise


def settled_alike(contacts: list[Contact], flights: list[Flight]) -> list[Contact]:
    """Assign the longest observed settling time to contacts whose start was not
    observed.

    The start is not observed, for example, if the recording begins in the middle of
    chatter.
    """
    long = [f.stop for f in flights if f.last - f.first > SHORTEST_FLIGHT]
    seen = [any(contact.start is stop for stop in long) for contact in contacts]
    known = [c.settled - c.start.time for c, one in zip(contacts, seen) if one]
    longest = max(known, default=0.0)
    return [
        contact
        if one
        else dataclasses.replace(
            contact, settled=min(contact.start.time + longest, contact.stop.time)
        )
        for contact, one in zip(contacts, seen)
    ]
