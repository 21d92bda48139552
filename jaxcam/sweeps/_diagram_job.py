"""The blocks of a bifurcation diagram."""

import functools
from collections.abc import Callable

import numpy as np
from jaxtyping import ArrayLike

from ..parameters import Pick
from ._inputs import LANES
from .attractors import label, settle
from .blocks import (
    about_section,
    AbstractJob,
    Arrays,
    digest,
    StoredVariable,
    StoreLayout,
)
from .sections import AbstractSection, component_coordinates, filled


_CHAIN = 16
"""Number of values in a block if the state is carried from one value to the next."""


class DiagramJob(AbstractJob):
    """Computes the motions at all values: independently for the direction "each";
    otherwise one after the other, each from the final state of the previous one.

    **Arguments:** `turns`, `keep`: a number for all values, or one for each value,
    which differ only if the state is carried; `dwell`: the times in seconds from which
    these numbers follow, if any.
    """

    def __init__(
        self,
        section: AbstractSection,
        where: Pick,
        values: np.ndarray,
        starts: np.ndarray,
        turns: ArrayLike,
        keep: ArrayLike,
        direction: str,
        period_tolerance: float,
        block: int | None,
        dwell: tuple[float, float] | None,
    ):
        self.section, self.where = section, where
        self.period_tolerance = period_tolerance
        self.chained = direction != "each"
        index, going = _order(values, direction)
        self.values, self.starts = values[index], starts[index]
        self.turns = np.broadcast_to(turns, values.shape)[index]
        self.keep = np.broadcast_to(keep, values.shape)[index]
        self.layout = self._layout(going, direction, block, dwell)

    def work(self, block: int, before: Arrays | None) -> Callable[[], Arrays]:
        first, last = self.layout.bounds(block)
        some = slice(first, last)
        what = self.section, self.where, self.values[some], self.starts[some]
        if not self.chained:
            turns, keep = int(self.turns[0]), int(self.keep[0])
            return functools.partial(
                each_value, *what, turns, keep, self.period_tolerance
            )
        return functools.partial(
            one_after_the_other,
            *what,
            None if before is None else before["final"][-1],
            self.turns[some],
            self.keep[some],
            int(self.keep.max()),
            self.period_tolerance,
        )

    def _layout(self, going, direction: str, block: int | None, dwell) -> StoreLayout:
        points, starts, n = self.starts.shape
        keep = int(self.keep.max())
        components = self.section.names(n)
        each, sampled = ("point", "start"), ("point", "start", "sample")
        variables = {
            "state": StoredVariable(
                (*sampled, "component"), (starts, keep, n), "float64"
            ),
            "hits": StoredVariable(sampled, (starts, keep), "int32"),
            "impacts": StoredVariable(each, (starts,), "int32"),
            "turns": StoredVariable(each, (starts,), "int32"),
            "code": StoredVariable(each, (starts,), "int32"),
        }
        if not self.section.regular:
            tail = (starts, keep)
            variables["time"] = StoredVariable(sampled, tail, "float64", {"units": "s"})
            variables["phase"] = StoredVariable(
                sampled, tail, "float64", {"units": "turns"}
            )
        if self.chained:
            dims = ("point", "start", "component")
            variables["final"] = StoredVariable(dims, (starts, n), "float64")
        coordinates = {
            self.where.names[0]: ("point", self.values, {"role": "parameter"}),
            "direction": ("point", going, {"about": "0 each, 1 up, -1 down"}),
            **component_coordinates(components),
        }
        identity = {
            "sweep": "diagram",
            **about_section(self.section),
            "where": list(self.where.names),
            "values": digest(self.values),
            "starts": digest(self.starts),
            "turns": int(self.turns.max()),
            "keep": keep,
            "direction": "up, then down" if direction == "both" else direction,
            "period_tolerance": self.period_tolerance,
        }
        if dwell is not None:
            identity["dwell"] = [float(seconds) for seconds in dwell]
        usual = _CHAIN if self.chained else max(1, LANES // starts)
        size = min(usual if block is None else block, points)
        identity["block"] = size
        return StoreLayout(points, size, variables, coordinates, identity)


def _order(values: np.ndarray, direction: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the order in which the values are passed, and the direction of each: 1
    upwards, -1 downwards, or 0.
    """
    if direction == "each":
        return np.arange(len(values)), np.zeros(len(values), dtype=np.int8)
    # a downward sweep continues from the final state of the upward sweep
    order = np.argsort(values, kind="stable")
    ways = {"up": (1,), "down": (-1,), "both": (1, -1)}[direction]
    index = np.concatenate([order[::way] for way in ways])
    return index, np.repeat(np.array(ways, dtype=np.int8), len(values))


def each_value(section, where, values, starts, turns, keep, period_tolerance) -> Arrays:
    """Compute all motions at the given values at once."""
    points, count, n = starts.shape
    lanes = np.repeat(values, count, axis=0)
    samples, labels = settle(
        section,
        starts.reshape(-1, n),
        turns,
        keep,
        period_tolerance=period_tolerance,
        where=where,
        values=lanes,
    )
    turn = section.turn(where, lanes)
    return _arrays(samples, labels, turn, (points, count))


def one_after_the_other(
    section, where, values, starts, carried, turns, keep, room, period_tolerance
) -> Arrays:
    """Compute the motions at the given values in order.

    **Arguments:** `carried`: the states before the first value, or None to start from
    the given initial states; `turns`, `keep`: one number for each value; `room`:
    number of samples stored at each value, padded with NaN.
    """
    rows = []
    for value, start, many, kept in zip(values, starts, turns, keep, strict=True):
        state = start if carried is None else carried
        # after a failed motion, start again from the given initial state
        state = np.where(np.isfinite(state).all(axis=1, keepdims=True), state, start)
        lanes = np.full(len(state), value)
        state = section.lifted(state, where, lanes)
        many, kept = int(many), int(kept)
        samples = section.sample(state, many, kept, where=where, values=lanes)
        counted = section.impacting and section.regular
        sizes = section.sizes(state, samples, where, lanes)
        labels = label(samples, period_tolerance, counted, sizes)
        carried = samples.final
        turn = section.turn(where, lanes)
        samples = filled(samples, room)
        made = _arrays(samples, labels, turn, (1, len(state)))
        rows.append(made | {"final": carried[None]})
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


def _arrays(samples, labels, turn, shape) -> Arrays:
    def put(array):
        return array.reshape(*shape, *array.shape[1:])

    return {
        "state": put(samples.states),
        "hits": put(samples.hits),
        "impacts": put(labels.impacts),
        "turns": put(labels.turns),
        "code": put(samples.code),
        "time": put(samples.times),
        "phase": put(np.mod(samples.times / turn[:, None], 1.0)),
    }
