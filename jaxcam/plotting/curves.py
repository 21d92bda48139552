"""Convert a trajectory to curves, broken at impacts and dense between them."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ..hybrid import Trajectory


# minimum number of points between two events, and number if that is shorter than the
# sampling interval
_BETWEEN_EVENTS, _SHORT_FLIGHT = 40, 8
_POINTS_IN_STEP = 4


class Curve(NamedTuple):
    """The curve of a trajectory between two times.

    Every flight and every contact ends with a row of NaN, so that a line through the
    rows does not show jumps; jumps are stored separately.
    """

    time: Float[np.ndarray, " k"]
    """Times (s), shape `(k,)`."""
    state: Float[np.ndarray, "k n"]
    """States, shape `(k, n)`."""
    gap: Float[np.ndarray, "k constraints"]
    """Gaps, shape `(k, constraints)`."""
    contact: Bool[np.ndarray, " k"]
    """Whether the row belongs to a contact, shape `(k,)`."""
    impact_time: Float[np.ndarray, " impacts"]
    """Times of impacts (s), shape `(impacts,)`."""
    before: Float[np.ndarray, "impacts n"]
    """States before the impacts, shape `(impacts, n)`."""
    after: Float[np.ndarray, "impacts n"]
    """States after the impacts, shape `(impacts, n)`."""
    contacts: Float[np.ndarray, "contacts 2"]
    """Start and end of each contact (s), shape `(contacts, 2)`."""


class Hits(NamedTuple):
    """The impacts within a span of time, without padding."""

    time: Float[np.ndarray, " k"]
    before: Float[np.ndarray, "k n"]
    after: Float[np.ndarray, "k n"]
    constraint: Int[np.ndarray, " k"]
    speed: Float[np.ndarray, " k"]
    """Speed of approach, positive."""


def window(
    trajectory: Trajectory, between: tuple[float, float] | None
) -> tuple[float, float]:
    """Return the span of time (s) to draw; the entire trajectory for `None`.

    **Raises:** `ValueError` if the trajectory does not cover it.
    """
    last = int(trajectory.steps.count) - 1
    t0, t1 = float(trajectory.t0), float(np.asarray(trajectory.steps.time)[last])
    if between is None:
        return t0, t1
    start, stop = float(between[0]), float(between[1])
    if not t0 <= start < stop <= t1:
        raise ValueError(
            f"The trajectory covers {t0:g} to {t1:g} s; give `between` as two "
            f"increasing times in it, not {start:g} and {stop:g}."
        )
    return start, stop


def hits(trajectory: Trajectory, start: float, stop: float) -> Hits:
    """Return the impacts with `start <= time <= stop`."""
    impacts = trajectory.impacts
    number = int(impacts.count)
    time = np.asarray(impacts.time)[:number]
    keep = (time >= start) & (time <= stop)

    def kept(values):
        return np.asarray(values)[:number][keep]

    return Hits(
        time[keep],
        kept(impacts.before),
        kept(impacts.after),
        kept(impacts.constraint),
        np.abs(kept(impacts.speed_before)),
    )


def contact_spans(
    trajectory: Trajectory, start: float, stop: float
) -> Float[np.ndarray, "contacts 2"]:
    """Return the start and end of every contact that overlaps the span; the part of a
    contact outside the span is cut off.
    """
    contacts = trajectory.contacts
    spans = np.stack([np.asarray(contacts.start), np.asarray(contacts.end)], axis=1)
    spans = spans[: int(contacts.count)].clip(start, stop)
    return spans[spans[:, 1] > spans[:, 0]]


def trajectory_curve(
    trajectory: Trajectory,
    between: tuple[float, float] | None = None,
    samples: int = 1500,
) -> Curve:
    """Return the part of a trajectory within `between` (s), with about `samples`
    points.

    Args:
        trajectory: A trajectory of `jaxcam.simulate`.
        between: Time span (s); default: the entire trajectory.
        samples: Number of points.

    Returns:
        A [`jaxcam.plotting.curves.Curve`][].

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.plotting.curves import trajectory_curve
        >>> motion = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
        >>> curve = trajectory_curve(motion, samples=100)
        >>> int(np.isnan(curve.time).sum())  # one after each of two flights
        2
        >>> curve.impact_time.round(4).tolist()
        [0.4515]
    """
    start, stop = window(trajectory, between)
    found = hits(trajectory, start, stop)
    spans = contact_spans(trajectory, start, stop)
    knots = np.unique(np.concatenate([[start, stop], found.time, spans.ravel()]))
    times = _times(trajectory, knots, samples)
    inner = np.searchsorted(times, knots)
    pieces = [times[i : j + 1] for i, j in zip(inner, inner[1:])]
    ends = np.cumsum([len(piece) for piece in pieces])
    time = np.concatenate(pieces)
    padded = _padded(time)
    state = np.array(trajectory.at(padded))[: len(time)]
    gap = np.asarray(trajectory.gap(padded))[: len(time)].reshape(len(time), -1)

    # `at` returns the state after an impact; a flight ends in the state before it
    for end, knot in zip(ends, knots[1:], strict=True):
        (hit,) = np.nonzero(found.time == knot)
        if len(hit):
            state[end - 1] = found.before[hit[0]]

    middles = (knots[:-1] + knots[1:]) / 2
    held = np.any(
        (middles[:, None] > spans[:, 0]) & (middles[:, None] < spans[:, 1]), 1
    )
    contact = np.repeat(held, [len(piece) for piece in pieces])
    return Curve(
        np.insert(time, ends, np.nan),
        np.insert(state, ends, np.nan, axis=0),
        np.insert(gap, ends, np.nan, axis=0),
        np.insert(contact, ends, held),
        found.time,
        found.before,
        found.after,
        spans,
    )


def _times(trajectory: Trajectory, knots, samples: int) -> np.ndarray:
    """Return the times of the points, with each knot (impact or end of a contact) once.

    The vector field changes at a switch, so the points are distributed between
    switches as between knots.
    """
    events = knots
    if trajectory.switches is not None:
        found = trajectory.switches
        switches = np.asarray(found.time)[: int(found.count)]
        inside = (switches > knots[0]) & (switches < knots[-1])
        events = np.unique(np.concatenate([knots, switches[inside]]))
    numbers = _points(trajectory, events, samples)
    parts = [
        np.linspace(a, b, n - 1, endpoint=False)
        for a, b, n in zip(events, events[1:], numbers)
    ]
    return np.append(np.concatenate(parts), events[-1])


def _points(trajectory: Trajectory, events, samples: int) -> list[int]:
    """Return the number of points between each two consecutive events."""
    every = (events[-1] - events[0]) / samples
    even = np.ceil(np.diff(events) / every) + 1
    least = np.where(np.diff(events) > every, _BETWEEN_EVENTS, _SHORT_FLIGHT)
    # a long run may oscillate between two evenly spaced points, but its integration
    # steps follow every oscillation
    steps = np.asarray(trajectory.steps.time)[: int(trajectory.steps.count)]
    follows = _POINTS_IN_STEP * np.diff(np.searchsorted(steps, events))
    return np.maximum(np.maximum(even, follows), least).astype(int).tolist()


def _padded(times):
    # pad to a power of two, so that few programs are compiled for many figures
    size = 1 << (len(times) - 1).bit_length()
    return np.pad(times, (0, size - len(times)), mode="edge")
