"""Count the events of a motion, for runs that do not list each event."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .codes import RowKind


class EventCounts(eqx.Module):
    """The numbers of events of a motion so far, as floats.

    The impacts of a complete chatter sequence count as one contact.
    """

    impacts: Float[Array, ""]
    """Number of impacts outside of complete chatter sequences."""
    contacts: Float[Array, ""]
    """Number of complete chatter sequences."""
    crossings: Float[Array, ""]
    """Number of crossings of switching surfaces."""
    slides: Float[Array, ""]
    """Number of times that sliding begins."""
    leaves: Float[Array, ""]
    """Number of times that a motion leaves a surface along which it slid, other than by
    an impact."""
    recent: Float[Array, ""]
    """Number of impacts since the last event of another kind."""
    order: Float[Array, ""]
    """Sign of the permutation that sorts the events by their constraint or surface: it
    changes where two events at different ones exchange their order."""

    @staticmethod
    def zero() -> "EventCounts":
        """Return the numbers at the start of a motion, all zero; the sign is 1."""
        return EventCounts(*(jnp.zeros(()) for _ in range(6)), order=jnp.ones(()))

    @staticmethod
    def of(
        kinds: Float[np.ndarray, " rows"], places: Float[np.ndarray, " rows"]
    ) -> "EventCounts":
        """Return the numbers in a motion, from the `RowKind` of each attempted step and
        the index of its constraint, or of its surface after all constraints.
        """
        quiet = (kinds <= float(RowKind.STEP)) | (kinds == float(RowKind.STOP))
        events, places = kinds[~quiet], places[~quiet]
        hits = events == float(RowKind.IMPACT)
        place = np.arange(1, len(events) + 1)
        others = np.maximum.accumulate(np.where(hits, 0, place))
        # of each event, the number of impacts that directly precede it
        recent = np.concatenate([[0], place - others])
        completes = events == float(RowKind.LAST_IMPACT)
        numbers = (
            np.sum(hits) - np.sum(recent[:-1][completes]),
            np.sum(completes),
            np.sum(events == float(RowKind.SWITCH)),
            np.sum(events == float(RowKind.SLIDE)),
            np.sum(events == float(RowKind.LEAVE)),
            recent[-1],
            _sign_of(places[_lasting(recent[:-1], completes)]),
        )
        return EventCounts(*jax.device_put([np.float64(n) for n in numbers]))

    def after(self, kind: Float[Array, ""]) -> "EventCounts":
        """Return the numbers after an attempted step of the given `RowKind`."""

        def one_if(which: RowKind):
            return jnp.where(kind == float(which), 1.0, 0.0)

        hits, completes = one_if(RowKind.IMPACT), one_if(RowKind.LAST_IMPACT)
        recent = jnp.where(is_quiet(kind), self.recent, 0.0)
        return EventCounts(
            impacts=self.impacts + hits - completes * self.recent,
            contacts=self.contacts + completes,
            crossings=self.crossings + one_if(RowKind.SWITCH),
            slides=self.slides + one_if(RowKind.SLIDE),
            leaves=self.leaves + one_if(RowKind.LEAVE),
            recent=jnp.where(hits > 0, self.recent + 1.0, recent),
            order=self.order,
        )


def is_quiet(kind: Float[Array, ""]):
    """Return whether an attempted step of this `RowKind` ends without an event."""
    return (kind <= float(RowKind.STEP)) | (kind == float(RowKind.STOP))


class EventOrder(eqx.Module):
    """The order of the events so far; see `EventCounts.order`."""

    sign: Float[Array, ""]
    """The sign of the permutation, +1 or -1."""
    odd: tuple
    """For each constraint and surface, -1 if it had an odd number of events, else 1."""
    before: tuple
    """Both of these before the latest impacts, which a completed chatter sequence would
    replace by one event."""

    @staticmethod
    def zero(number: int) -> "EventOrder":
        """Return the order at the start of a motion with this many rows."""
        one = jnp.ones(())
        return EventOrder(one, (one,) * number, (one, (one,) * number))

    def after(self, kind: Float[Array, ""], place: Float[Array, ""]) -> "EventOrder":
        """Return the order after an attempted step of the given `RowKind` at a
        constraint, or at a surface, which is numbered after all constraints.
        """
        quiet, hits = is_quiet(kind), kind == float(RowKind.IMPACT)
        completes = kind == float(RowKind.LAST_IMPACT)
        sign = jnp.where(completes, self.before[0], self.sign)
        pairs = zip(self.before[1], self.odd, strict=True)
        odd = [jnp.where(completes, old, new) for old, new in pairs]
        passed = jnp.ones(())
        for k in reversed(range(len(odd))):
            here = ~quiet & (place == float(k))
            sign = jnp.where(here, sign * passed, sign)
            passed = passed * odd[k]
            odd[k] = jnp.where(here, -odd[k], odd[k])
        kept = quiet | hits
        before = (
            jnp.where(kept, self.before[0], sign),
            tuple(
                jnp.where(kept, a, b) for a, b in zip(self.before[1], odd, strict=True)
            ),
        )
        return EventOrder(sign, tuple(odd), before)


def _lasting(recent, completes) -> np.ndarray:
    """Return which events remain if the impacts of completed chatter do not count."""
    kept = np.ones(len(completes), dtype=bool)
    for place in np.flatnonzero(completes):
        kept[place - int(recent[place]) : place] = False
    return kept


def _sign_of(places) -> float:
    """Return the sign of the permutation that sorts events by their places."""
    rows = int(np.max(places, initial=-1)) + 1
    at = places[:, None] == np.arange(rows)
    earlier = np.cumsum(at, axis=0) - at
    larger = np.arange(rows) > places[:, None]
    return 1.0 - 2.0 * (int(np.sum(earlier * larger)) % 2)
