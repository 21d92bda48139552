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
    recent: Float[Array, ""]
    """Number of impacts since the last event of another kind."""

    @staticmethod
    def zero() -> "EventCounts":
        """Return the numbers at the start of a motion, all zero."""
        return EventCounts(*(jnp.zeros(()) for _ in range(5)))

    @staticmethod
    def of(kinds: Float[np.ndarray, " rows"]) -> "EventCounts":
        """Return the numbers in a motion, from the `RowKind` of each attempted step."""
        quiet = (kinds <= float(RowKind.STEP)) | (kinds == float(RowKind.STOP))
        events = kinds[~quiet]
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
            recent[-1],
        )
        return EventCounts(*jax.device_put([np.float64(n) for n in numbers]))

    def after(self, kind: Float[Array, ""]) -> "EventCounts":
        """Return the numbers after an attempted step of the given `RowKind`."""

        def one_if(which: RowKind):
            return jnp.where(kind == float(which), 1.0, 0.0)

        hits, completes = one_if(RowKind.IMPACT), one_if(RowKind.LAST_IMPACT)
        quiet = (kind <= float(RowKind.STEP)) | (kind == float(RowKind.STOP))
        recent = jnp.where(quiet, self.recent, 0.0)
        return EventCounts(
            impacts=self.impacts + hits - completes * self.recent,
            contacts=self.contacts + completes,
            crossings=self.crossings + one_if(RowKind.SWITCH),
            slides=self.slides + one_if(RowKind.SLIDE),
            recent=jnp.where(hits > 0, self.recent + 1.0, recent),
        )
