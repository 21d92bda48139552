"""The events of a trajectory, and its integration points."""

import enum

import numpy as np
from jaxtyping import Bool, Float, Int

from ...parameters import AnyArray
from ...tables import ShortTable
from ._printed import numbers, Printed, vector_text


class Impacts(Printed):
    """The impacts of a trajectory, in order.

    Under a transformation (`jit`, `vmap`, `grad`), the arrays have a fixed length k:
    the first `count` entries are valid, later times are inf, and later states are NaN.
    While a trajectory is assembled outside of transformations, NumPy arrays are used
    instead.
    """

    time: Float[AnyArray, " k"]
    """Time of each impact (s), shape `(k,)`."""
    before: Float[AnyArray, "k n"]
    """State just before each impact, shape `(k, n)`."""
    after: Float[AnyArray, "k n"]
    """State just after each impact, shape `(k, n)`."""
    constraint: Int[AnyArray, " k"]
    """Index of the constraint that was hit, shape `(k,)`."""
    speed_before: Float[AnyArray, " k"]
    """Normal velocity before the impact, negative, shape `(k,)`."""
    speed_after: Float[AnyArray, " k"]
    """Normal velocity after the impact, positive, shape `(k,)`."""
    count: Int[AnyArray | np.integer, ""]
    """Number of impacts."""

    def _batched(self) -> bool:
        return np.ndim(self.count) > 0

    def _table(self) -> ShortTable:
        return impact_table(self, f"impacts: {int(self.count)}")


class Contacts(Printed):
    """The intervals of sustained contact (sticking), in order; padded like `Impacts`.

    For a contact that lasts beyond the run, `released` is False and `end` is the end of
    the run.
    """

    start: Float[AnyArray, " m"]
    """Start of the contact (s), the accumulation time of the chatter or t0; shape
    `(m,)`.
    """
    end: Float[AnyArray, " m"]
    """End of the contact (s), usually its release; shape `(m,)`."""
    released: Bool[AnyArray, " m"]
    """Whether the contact ended by release, shape `(m,)`."""
    constraint: Int[AnyArray, " m"]
    """Index of the constraint, shape `(m,)`."""
    count: Int[AnyArray | np.integer, ""]
    """Number of contacts."""

    def _batched(self) -> bool:
        return np.ndim(self.count) > 0

    def _table(self) -> ShortTable:
        columns = (self.start, self.end, self.constraint, self.released)
        rows = [
            (str(k + 1), f"{a:.8g}", f"{b:.8g}", str(which), "yes" if free else "no")
            for k, (a, b, which, free) in enumerate(
                zip(*(numbers(one, self.count) for one in columns), strict=True)
            )
        ]
        headings = ("contact", "start (s)", "end (s)", "constraint", "released")
        return ShortTable(f"contacts: {len(rows)}", headings, rows)


class SwitchKind(enum.IntEnum):
    """The kinds of events at a switching surface."""

    CROSSES = 0
    """The motion crosses the surface."""
    SLIDES = 1
    """The motion begins to slide along the surface; with dry friction, the body sticks.
    """
    LEAVES = 2
    """The motion leaves the surface along which it slid."""


_SAID = {
    SwitchKind.CROSSES: "crosses",
    SwitchKind.SLIDES: "begins sliding",
    SwitchKind.LEAVES: "leaves",
}


class Switches(Printed):
    """The events at switching surfaces, in order; padded like `Impacts`.

    An impact that ends sliding, because it moves the state off the surface, is listed
    only among the impacts. If sliding begins or ends on several surfaces at the same
    instant, as under two feet of a rigid body, only one of them is listed;
    `Steps.sides` contains all.
    """

    time: Float[AnyArray, " k"]
    """Time of each event (s), shape `(k,)`."""
    before: Float[AnyArray, "k n"]
    """State just before each event, shape `(k, n)`."""
    after: Float[AnyArray, "k n"]
    """State just after each event, different only where the surface has a `reset`,
    shape `(k, n)`.
    """
    surface: Int[AnyArray, " k"]
    """Index of the surface, shape `(k,)`."""
    direction: Float[AnyArray, " k"]
    """+1 if the switching function rises at the event, -1 if it falls, shape `(k,)`."""
    count: Int[AnyArray | np.integer, ""]
    """Number of events."""
    kind: Int[AnyArray, " k"]
    """Kind of each event (`SwitchKind`): 0 for a crossing, 1 for the beginning of
    sliding, 2 for its end; shape `(k,)`.
    """

    def _batched(self) -> bool:
        return np.ndim(self.count) > 0

    def _table(self) -> ShortTable:
        columns = (self.time, self.surface, self.direction, self.kind, self.after)
        rows = [
            (
                str(k + 1),
                f"{t:.8g}",
                str(which),
                "rising" if direction > 0 else "falling",
                _SAID[SwitchKind(int(kind))],
                vector_text(state),
            )
            for k, (t, which, direction, kind, state) in enumerate(
                zip(*(numbers(one, self.count) for one in columns), strict=True)
            )
        ]
        headings = ("switch", "time (s)", "surface", "direction", "motion", "state")
        return ShortTable(f"switches: {len(rows)}", headings, rows)


class Steps(Printed):
    """The integration points, with the modes of the motion."""

    time: Float[AnyArray, " s"]
    """Time of each point (s), shape `(s,)`."""
    state: Float[AnyArray, "s n"]
    """State at each point, shape `(s, n)`."""
    contact: Bool[AnyArray, "s constraints"]
    """Whether each constraint is in contact from this point on, shape
    `(s, constraints)`."""
    count: Int[AnyArray | np.integer, ""]
    """Number of points."""
    sides: Float[AnyArray, "s surfaces"] | None = None
    """Sides of the switching surfaces from this point on, +1 or -1, or 0 while the
    motion slides, shape `(s, surfaces)`; `None` without surfaces."""

    def _batched(self) -> bool:
        return np.ndim(self.count) > 0

    def _table(self) -> ShortTable:
        columns = (self.time, self.state, self.contact)
        rows = [
            (
                str(k + 1),
                f"{t:.8g}",
                vector_text(state),
                ", ".join(map(str, np.flatnonzero(held))) or "-",
            )
            for k, (t, state, held) in enumerate(
                zip(*(numbers(one, self.count) for one in columns), strict=True)
            )
        ]
        headings = ("point", "time (s)", "state", "constraints in contact")
        return ShortTable(f"integration points: {len(rows)}", headings, rows)


def impact_table(impacts: Impacts, sentence: str) -> ShortTable:
    """Return a table of the times and speeds of impacts, headed by a sentence."""
    columns = (
        impacts.time,
        impacts.constraint,
        impacts.speed_before,
        impacts.speed_after,
    )
    rows = [
        (str(k + 1), f"{t:.8g}", str(which), f"{-before:.6g}", f"{after:.6g}")
        for k, (t, which, before, after) in enumerate(
            zip(*(numbers(one, impacts.count) for one in columns), strict=True)
        )
    ]
    headings = ("impact", "time (s)", "constraint", "approach", "rebound")
    return ShortTable(sentence, headings, rows)
