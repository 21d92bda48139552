"""The blocks of a bifurcation diagram."""

import functools
from collections.abc import Callable

import numpy as np

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
    """Computes the motions at all values independently."""

    chained = False

    def __init__(
        self,
        section: AbstractSection,
        where: Pick,
        values: np.ndarray,
        starts: np.ndarray,
        turns: int,
        keep: int,
        direction: str,
        period_tolerance: float,
        block: int | None,
    ):
        self.section, self.where = section, where
        self.turns, self.keep, self.period_tolerance = turns, keep, period_tolerance
        self.values, self.starts, going = self._ordered(values, starts, direction)
        self.layout = self._layout(going, direction, block)

    def _ordered(self, values, starts, direction):
        return values, starts, np.zeros(len(values), dtype=np.int8)

    def _block(self, starts: int) -> int:
        return max(1, LANES // starts)

    def work(self, block: int, before: Arrays | None) -> Callable[[], Arrays]:
        del before
        first, last = self.layout.bounds(block)
        return functools.partial(
            each_value,
            self.section,
            self.where,
            self.values[first:last],
            self.starts[first:last],
            self.turns,
            self.keep,
            self.period_tolerance,
        )

    def _layout(self, going, direction: str, block: int | None) -> StoreLayout:
        points, starts, n = self.starts.shape
        keep = self.keep
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
        values = self.values[:, None] if self.values.ndim == 1 else self.values
        coordinates = {
            name: ("point", values[:, i], {"role": "parameter"})
            for i, name in enumerate(self.where.names)
        }
        coordinates |= {
            "direction": ("point", going, {"about": "0 each, 1 up, -1 down"}),
            **component_coordinates(components),
        }
        identity = {
            "sweep": "diagram",
            **about_section(self.section),
            "where": list(self.where.names),
            "values": digest(self.values),
            "starts": digest(self.starts),
            "turns": self.turns,
            "keep": keep,
            "direction": "up, then down" if direction == "both" else direction,
            "period_tolerance": self.period_tolerance,
        }
        size = self._block(starts) if block is None else block
        size = min(size, points)
        identity["block"] = size
        return StoreLayout(points, size, variables, coordinates, identity)


class CarriedJob(DiagramJob):
    """Computes the motions at increasing values, decreasing values or both; each motion
    starts from the final state of the previous one.
    """

    chained = True

    def _ordered(self, values, starts, direction):
        order = np.argsort(values, kind="stable")
        ways = {"up": (1,), "down": (-1,), "both": (1, -1)}[direction]
        index = np.concatenate([order[::way] for way in ways])
        going = np.repeat(np.array(ways, dtype=np.int8), len(values))
        self.first = np.zeros(len(index), dtype=bool)
        # only the first motion starts from a given state; a downward sweep continues
        # from the final state of the upward sweep
        self.first[0] = True
        return values[index], starts[index], going

    def _block(self, starts: int) -> int:
        del starts
        return _CHAIN

    def work(self, block: int, before: Arrays | None) -> Callable[[], Arrays]:
        first, last = self.layout.bounds(block)
        return functools.partial(
            one_after_the_other,
            self.section,
            self.where,
            self.values[first:last],
            self.starts[first:last],
            self.first[first:last],
            None if before is None else before["final"][-1],
            np.full(last - first, self.turns),
            np.full(last - first, self.keep),
            self.keep,
            self.period_tolerance,
        )

    def _layout(self, going, direction: str, block: int | None) -> StoreLayout:
        layout = super()._layout(going, direction, block)
        starts, n = self.starts.shape[1:]
        final = StoredVariable(("point", "start", "component"), (starts, n), "float64")
        return layout._replace(variables={**layout.variables, "final": final})


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
    section, where, values, starts, first, carried, turns, keep, room, period_tolerance
) -> Arrays:
    """Compute the motions at the given values in order; `first` marks the values at
    which the motions start from the given initial states.

    **Arguments:** `turns`, `keep`: one number for each value; `room`: number of samples
    stored at each value, padded with NaN.
    """
    rows = []
    for value, start, anew, many, kept in zip(
        values, starts, first, turns, keep, strict=True
    ):
        state = start if anew or carried is None else carried
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
