"""Allow for impacts near the ends of a recording, and for impacts before it began."""

import dataclasses

import numpy as np
from jaxtyping import Float

from ._contact_stretches import LOW, SHORTEST_FLIGHT, Span
from ._kinks import WINDOW
from ._motion import Motion
from ._segments import Contact, Flight


# Number of samples used to extrapolate a flight
_LEAST = 12
# Degree of the polynomial that describes a flight too short for this, and the fewest
# samples on the far side of an impact in it
_DEGREE, _FEWEST = 3, 6
# Rms residual (in units of the noise) above which a polynomial misses an impact, and
# below which the same polynomial with a kink describes both sides of it
_MISSED, _DESCRIBED = 3.0, 1.5


def clear_of_end(motion: Motion, span: Span) -> Span:
    """Return the part of a flight that is certainly before an impact at the end of the
    recording, and after one at its beginning. So close to an end, an impact affects too
    few samples to be detected, but it can be predicted by extrapolating the flight. In
    a flight too short for this, it is the kink of a polynomial.
    """
    first, last = span
    count = len(motion.time)
    tail = max(SHORTEST_FLIGHT + 1, round(WINDOW / motion.interval))
    if last - first < tail + _LEAST:
        gap = motion.gap[first:last] / motion.noise
        if first == 0 and last < count:
            return first + _length_to_kink(gap), last
        if last == count and first > 0:
            return first, last - _length_to_kink(gap[::-1])
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


def _length_to_kink(gap: Float[np.ndarray, " k"]) -> int:
    """Return the number of samples up to an impact near the beginning of a short
    flight, zero without one.

    **Arguments:** the gap at every sample, in units of its noise.
    """
    count = len(gap)
    place = np.linspace(-1.0, 1.0, count)
    powers = np.vander(place, _DEGREE + 1)
    if count < _DEGREE + 3 + _FEWEST or _fitted(powers, gap)[0] < _MISSED:
        return 0
    best, least = 0, _DESCRIBED
    for k in range(1, count - _FEWEST):
        # a kink anywhere between two samples is a step and a change of slope
        after = place >= place[k]
        design = np.column_stack([powers, after, after * (place - place[k])])
        rms, found = _fitted(design, gap)
        # an impact sends the bodies apart
        if rms < least and found[-1] > 0:
            best, least = k, rms
    # the sample after an impact may lie on its other side
    return best + 1 if best else 0


def _fitted(design, gap):
    """Return the rms residual of a linear fit, per degree of freedom, and its
    coefficients.
    """
    found = np.linalg.lstsq(design, gap)[0]
    off = gap - design @ found
    return np.sqrt(off @ off / (len(gap) - design.shape[1])), found


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
