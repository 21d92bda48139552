"""Figure 6.2: the first branches of the grazing manifold of the rig."""

from matplotlib.figure import Figure

from ...models import CamFollower
from ..target import Rows, Target
from .manifold import draw_manifold, manifold_of, manifold_rows


BRANCHES = 2
"""Number of curves S^k, and of curves W^k, that are shown."""


def compute(system: CamFollower) -> Rows:
    return manifold_rows(system, BRANCHES)


def draw(system: CamFollower) -> Figure:
    return draw_manifold(manifold_of(system, BRANCHES), most=None)


TARGET = Target("The grazing manifold", compute, draw)
