"""Divide a period of an orbit at its events, into arrays of a few fixed lengths."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from jaxcam.hybrid.record import Contacts, Impacts


NOTHING, IMPACT, LAST_IMPACT = 0, 1, 2
"""End of a piece: no event (but the mode may change), an impact, or the impact at which
chatter is completed.
"""


class TurnPieces(eqx.Module):
    """Pieces of flight or contact, each with the event at its end.

    Pieces beyond the last event are padding of zero duration. The arrays are NumPy
    arrays.
    """

    start: Float[np.ndarray, " k"]
    end: Float[np.ndarray, " k"]
    kind: Int[np.ndarray, " k"]
    constraint: Int[np.ndarray, " k"]
    before: Float[np.ndarray, "k n"]
    """State before the event, (k, n)."""
    contact: Bool[np.ndarray, "k m"]
    """Constraints in contact during the piece, (k, m), where m is just large enough to
    include every constraint that is hit or touched.
    """
    contact_after: Bool[np.ndarray, "k m"]
    """Constraints in contact during the next piece, (k, m)."""


def cut_turn(
    impacts: Impacts, contacts: Contacts, state, t0: float, t1: float
) -> tuple[TurnPieces, bool]:
    """Return the pieces of the period from t0 to t1, and whether there is any contact.

    **Arguments:** the events of the period, and the state at t0.
    """
    state = np.asarray(state)
    time, which = np.asarray(impacts.time), np.asarray(impacts.constraint)
    before = np.asarray(impacts.before)
    number = int(impacts.count)
    sides = np.asarray(contacts.constraint)[: int(contacts.count)]
    m = 1 + int(max(which[:number].max(initial=0), sides.max(initial=0)))
    kind = np.full(number, IMPACT)
    spans = []
    for k in range(int(contacts.count)):
        begin, side = float(contacts.start[k]), int(contacts.constraint[k])
        end = float(contacts.end[k]) if bool(contacts.released[k]) else np.inf
        earlier = np.flatnonzero((time[:number] <= begin) & (which[:number] == side))
        if begin > t0 and len(earlier):
            # contact counts from the last listed impact, because the remaining impacts
            # take no time
            kind[earlier[-1]] = LAST_IMPACT
            begin = time[earlier[-1]]
        spans.append((begin, end, side))
    releases = [end for _, end, _ in spans if end < t1]
    own = [(time[i], kind[i], which[i], before[i]) for i in range(number)]
    # a release at an impact is already listed as that impact
    let_go = [(end, NOTHING, 0, state) for end in releases if end not in time]
    events = sorted(own + let_go, key=lambda event: event[0])
    events.append((t1, NOTHING, 0, state))
    times = np.array([t0, *(event[0] for event in events)])
    modes = np.zeros((len(events), m), dtype=bool)
    for begin, end, side in spans:
        middle = (times[:-1] + times[1:]) / 2
        modes[:, side] |= (middle >= begin) & (middle <= end)
    length = 1
    while length < len(events):
        length *= 2
    spare = length - len(events)

    def filled(values, last):
        values = np.asarray(values)
        shape = (spare, *values.shape[1:])
        more = np.broadcast_to(last, shape).astype(values.dtype)
        return np.concatenate([values, more])

    after = np.concatenate([modes[1:], modes[-1:]])
    pieces = TurnPieces(
        start=filled(times[:-1], t1),
        end=filled(times[1:], t1),
        kind=filled([event[1] for event in events], NOTHING),
        constraint=filled([event[2] for event in events], 0),
        before=filled([event[3] for event in events], state),
        contact=filled(modes, modes[-1]),
        contact_after=filled(after, modes[-1]),
    )
    return pieces, bool(spans)
