"""Figure 6.10: the chatter of the orbit at 152.67 rpm, enlarged."""

from matplotlib.figure import Figure

from ...models import CamFollower
from ..target import Target
from .orbit_marks import compute_marks, draw_marks


def draw(system: CamFollower) -> Figure:
    return draw_marks(system, close=True)


TARGET = Target("Chatter of the orbit at 152.67 rpm, enlarged", compute_marks, draw)
