"""Define figures that show motions, as time series next to phase portraits."""

import dataclasses
from collections.abc import Callable, Sequence

from matplotlib.figure import Figure

from ..models import CamFollower
from .motion_drawing import motion_figure
from .settled import motion_rows, settled, SettledMotion, ShownMotion
from .target import Rows, Target


RECORDED_NOTE = (
    "The thesis shows a recording; printed is what it says of that. Simulated is the "
    "rig at the same speed: the two differ where Table 5.1 says so."
)
WINDOW = (
    "An orbit that sticks forgets its past, so within the chaos behind the "
    "interruption there are windows of orbits that rest once in several turns."
)


@dataclasses.dataclass(frozen=True)
class MotionTarget(Target):
    """A figure of motions that have settled."""

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

    **Arguments:** `layout`: function that draws the rig's motions instead.
    """

    def compute(system: CamFollower) -> Rows:
        return motion_rows(motions(system, cases))

    def draw(system: CamFollower) -> Figure:
        return layout(system, motions(system, cases))

    return MotionTarget(title, compute, draw, note=note, cases=cases)
