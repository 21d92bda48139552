"""Progress of the long computations of a target.

Targets are functions of a rig, whose results are remembered by their arguments.
Therefore the callback is not an argument of each, but of the context that runs them.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, TypeAlias

from ..models import rad_s_to_rpm
from ..sweeps.blocks import Progress


if TYPE_CHECKING:
    from continuation import Point


Report: TypeAlias = Callable[[str, float | None], None]
"""Takes a sentence and a fraction, or None."""


def _ignore(sentence: str, fraction: float | None) -> None:
    del sentence, fraction


_REPORT: ContextVar[Report] = ContextVar("report", default=_ignore)


@contextmanager
def reporting(progress: Report | None) -> Iterator[None]:
    """Let the targets that are computed inside report to `progress`."""
    token = _REPORT.set(progress or _ignore)
    try:
        yield
    finally:
        _REPORT.reset(token)


def report(sentence: str, fraction: float | None = None) -> None:
    """Tell the caller of the target its present computation, and the fraction done."""
    _REPORT.get()(sentence, fraction)


def of_sweep(sentence: str) -> Callable[[Progress], None]:
    """The `progress` of a sweep inside a target."""

    def callback(at: Progress) -> None:
        report(sentence, at.done / at.total)

    return callback


def of_share(sentence: str) -> Callable[[float], None]:
    """The `progress` of a computation that tells the fraction done."""
    return lambda share: report(sentence, share)


def of_point(point: "Point") -> None:
    """A callback of a branch over the speed."""
    report(f"following a branch, {float(rad_s_to_rpm(point.parameter)):.6g} rpm")
