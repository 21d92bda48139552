"""Report progress of the long computations of a target.

Targets are functions of a rig whose results are cached by argument. The callback is
therefore set by a context manager instead of being passed as an argument.
"""

from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from ..models import rad_s_to_rpm
from ..sweeps.blocks import Progress


if TYPE_CHECKING:
    from continuation import Point


_T = TypeVar("_T")

Report: TypeAlias = Callable[[str, float | None], None]
"""Callback that takes a sentence and the completed fraction (or None)."""


def _ignore(sentence: str, fraction: float | None) -> None:
    del sentence, fraction


_REPORT: ContextVar[Report] = ContextVar("report", default=_ignore)


@contextmanager
def reporting(progress: Report | None) -> Iterator[None]:
    """Direct the reports of targets computed inside the context to `progress`."""
    token = _REPORT.set(progress or _ignore)
    try:
        yield
    finally:
        _REPORT.reset(token)


def report(sentence: str, fraction: float | None = None) -> None:
    """Report the current computation of a target, and the fraction done."""
    _REPORT.get()(sentence, fraction)


def of_sweep(sentence: str) -> Callable[[Progress], None]:
    """Return the `progress` callback for a sweep inside a target."""

    def callback(at: Progress) -> None:
        report(sentence, at.done / at.total)

    return callback


def of_share(sentence: str) -> Callable[[float], None]:
    """Return the `progress` callback for a computation that reports the fraction
    done.
    """
    return lambda share: report(sentence, share)


def of_branch(low: float, high: float) -> "Callable[[Point], None]":
    """Return the callback for a branch that is followed between two speeds (rpm).

    It reports the number of points and the fraction of the range that they span.
    """
    seen: list[float] = []

    def callback(point: "Point") -> None:
        seen.append(float(rad_s_to_rpm(point.parameter)))
        share = (max(seen) - min(seen)) / (high - low)
        report(
            f"following a branch, point {len(seen)} at {seen[-1]:.6g} rpm",
            min(share, 1.0),
        )

    return callback


def counted(sentence: str, items: Collection[_T]) -> Iterator[_T]:
    """Yield each item after reporting its number and the completed fraction."""
    for k, item in enumerate(items):
        report(f"{sentence}, {k + 1} of {len(items)}", k / len(items))
        yield item
