"""Define figures that show motions as time series and phase portraits."""

import dataclasses
from collections.abc import Callable, Sequence

from matplotlib.figure import Figure

from ..models import CamFollower
from .motion_drawing import motion_figure
from .settled import motion_rows, settled, SettledMotion, ShownMotion
from .target import Rows, Target


RECORDED_NOTE = (
    "The thesis shows a recording; the printed values are taken from its description. "
    "The computed values are from a simulation at the same speed. The two differ where "
    "the two columns of Table 5.1 differ."
)
WINDOW = (
    "The motion after sticking does not depend on the past, so the chaos beyond the "
    "interruption contains windows with orbits that stick once in several cycles."
)


@dataclasses.dataclass(frozen=True)
class MotionTarget(Target):
    """A figure of settled motions."""

    cases: tuple[ShownMotion, ...] = ()


def motions(system: CamFollower, cases: tuple[ShownMotion, ...]) -> list[SettledMotion]:
    """Return the motions of a figure; those of all figures are computed together."""
    from .registry import TARGETS

    shown = (t.cases for t in TARGETS.values() if isinstance(t, MotionTarget))
    every = tuple(dict.fromkeys(case for some in (*shown, cases) for case in some))
    found = dict(zip(every, settled(system, every), strict=True))
    return [found[case] for case in cases]


def motion_target(
    title: str,
    *cases: ShownMotion,
    note: str = "",
    layout: Callable[[CamFollower, Sequence[SettledMotion]], Figure] = motion_figure,
) -> MotionTarget:
    """Create the target of a figure of motions, drawn one below the other.

    **Arguments:** `layout`: function that draws the motions in another arrangement.
    """

    def compute(system: CamFollower) -> Rows:
        return motion_rows(motions(system, cases))

    def draw(system: CamFollower) -> Figure:
        return layout(system, motions(system, cases))

    return MotionTarget(title, compute, draw, note=note, cases=cases)
