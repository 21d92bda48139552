"""What can be reproduced: a name, a sentence, and the function that computes it."""

from collections.abc import Callable
from typing import Literal, NamedTuple, TYPE_CHECKING

from ..models import CamFollower
from . import (
    _chapter_5_chatter as chatter,
    _chapter_5_diagrams as diagrams,
    _chapter_5_map as local_map,
    _chapter_6_manifold as manifold,
    _chapter_6_rebuilt as rebuilt,
    _chapter_6_sequence as sequence,
)
from ._chapter_1 import figure_1_2, figure_1_3
from ._chapter_2 import figure_2_3, figure_2_4, figure_2_7, figure_2_11, figure_2_13
from ._chapter_2_manifolds import figure_2_8
from ._chapter_2_sliding import figure_2_14
from ._chapter_3 import figure_3_8, figure_3_11
from ._chapter_3_branches import figure_3_9, figure_3_12
from ._chapter_4 import (
    figure_4_5,
    figure_4_13,
    figure_4_14,
    figure_4_15,
    figure_4_16,
)
from ._chapter_4_experiment import figure_4_17, figure_4_18
from ._chapter_5_basins import basins_table
from ._chapter_5_motions import motion_table, released_table
from ._table_4_4 import table_4_4
from ._table_5_2 import table_5_2
from ._table_5_3 import table_5_3
from ._table_6_1 import table_6_1
from ._table_6_2 import table_6_2
from ._table_6_3 import table_6_3
from ._table_6_4 import table_6_4


if TYPE_CHECKING:
    import pandas as pd


Size = Literal["default", "full"]


class Target(NamedTuple):
    """A table of the thesis, or the numbers of a figure."""

    title: str
    #: takes the rig; returns columns quantity, printed, computed, unit, difference,
    #: relative
    compute: "Callable[..., pd.DataFrame]"
    #: whether it also takes a size, "default" or "full"
    sized: bool = False
    #: what to know of it when comparing
    note: str = ""


_RECORDED = (
    "The thesis shows a recording; printed is what it says of that. Simulated is the "
    "rig at the same speed: the two differ where Table 5.1 says so."
)
_EXPERIMENT = (
    "At each speed a minute passes and ten seconds are stored, as printed, forward "
    "from 120 to 200 rpm and backward to 150; the distance of speeds is not printed. "
    "The rig is the simulated one, so it meets the events of the model: Table 5.1 "
    "prints those of the real one, too. Backward ends before P(1,1) does."
)
_NO_RINGS = (
    "The printed figure is of cells and shows rings; motions followed to their end all "
    "settle on one chaotic attractor."
)
_WINDOW = (
    "An orbit that sticks forgets its past, so within the chaos behind the "
    "interruption there are windows of orbits that rest once in several turns."
)


def _motion(target: str, title: str, note: str = "") -> Target:
    return Target(title, motion_table(target), note=note)


TARGETS: dict[str, Target] = {
    "figure-1.2": Target("A periodic orbit with chatter", figure_1_2),
    "figure-1.3": Target("Chatter, complete and interrupted", figure_1_3),
    "figure-2.3": Target("Cobwebs of the logistic map", figure_2_3),
    "figure-2.4": Target("The period-doubling cascade", figure_2_4),
    "figure-2.7": Target("Normal forms of codimension one", figure_2_7),
    "figure-2.8": Target("Manifolds of the saddle of an impact oscillator", figure_2_8),
    "figure-2.11": Target("Piecewise-smooth maps", figure_2_11),
    "figure-2.13": Target("The Zeno ball, by events and by steps", figure_2_13),
    "figure-2.14": Target("Sliding bifurcations of a mass on a belt", figure_2_14),
    "figure-3.8": Target("The P(1,1) orbit and its branch", figure_3_8),
    "figure-3.9": Target("The branch that sticks, to its interruption", figure_3_9),
    "figure-3.11": Target("The discontinuous flow of P(1,1)", figure_3_11),
    "figure-3.12": Target("The P(1,1) branch around its fold", figure_3_12),
    "table-4.4": Target("Parameters of the model", table_4_4),
    "figure-4.5": Target("A motion program with four dwells", figure_4_5),
    "figure-4.13": Target("The follower without its cam", figure_4_13),
    "figure-4.14": Target("Permanent contact at 110 rpm", figure_4_14),
    "figure-4.15": Target("Restitution by speed", figure_4_15),
    "figure-4.16": Target("Bounces at four speeds", figure_4_16),
    "figure-4.17": Target(
        "Events of the experiment of section 4.7, with a simulated rig",
        figure_4_17,
        sized=True,
        note=_EXPERIMENT,
    ),
    "figure-4.18": Target(
        "The experiment of section 4.7, forward and backward",
        figure_4_18,
        sized=True,
        note=_EXPERIMENT,
    ),
    "figure-4.19": _motion("figure-4.19", "Permanent contact at 120 rpm", _RECORDED),
    "figure-4.20": _motion("figure-4.20", "P(inf,1) at 150 rpm", _RECORDED),
    "figure-4.21": Target(
        "Interruption of chattering", released_table("figure-4.21"), note=_RECORDED
    ),
    "figure-4.22": _motion("figure-4.22", "Chaos at 165 rpm", _RECORDED),
    "figure-4.23": _motion("figure-4.23", "P(1,1) at 165 rpm", _RECORDED),
    "figure-4.24": _motion("figure-4.24", "P(2,2) at 188 rpm", _RECORDED),
    "table-5.1": Target(
        "Speeds of the main events, the simulated column",
        diagrams.table_5_1,
        sized=True,
        note="Read off the diagram of Figure 5.1, so known to its distance of speeds. "
        "The printed end of P(2,2) is that of the whole diagram.",
    ),
    "table-5.2": Target("Multipliers along the P(1,1) branch", table_5_2),
    "table-5.3": Target("Local map at the interruption of chattering", table_5_3),
    "figure-5.1": Target(
        "Bifurcation diagram, up and down", diagrams.figure_5_1, sized=True
    ),
    "figure-5.2": _motion("figure-5.2", "Motions along the diagram", _WINDOW),
    "figure-5.3": _motion("figure-5.3", "P(1,1) at 145 rpm"),
    "figure-5.4": _motion("figure-5.4", "P(2,2) at 152 rpm"),
    "figure-5.5": _motion("figure-5.5", "P(4,4) at 158 rpm"),
    "figure-5.6": _motion("figure-5.6", "Permanent contact at 120 rpm"),
    "figure-5.7": _motion("figure-5.7", "P(inf,1) at 148 rpm"),
    "figure-5.8": Target("Chatter, complete and less so", released_table("figure-5.8")),
    "figure-5.9": Target("Impacts on the route to chaos", chatter.figure_5_9),
    "figure-5.10": _motion("figure-5.10", "Chaos at 154.1 rpm", _WINDOW),
    "figure-5.11": Target(
        "The onset of aperiodic motion", diagrams.figure_5_11, sized=True
    ),
    "figure-5.12": Target(
        "Coexistence, from random starts", diagrams.figure_5_12, sized=True
    ),
    "figure-5.14": Target("Basins at 145 rpm", basins_table("figure-5.14"), sized=True),
    "figure-5.15": _motion("figure-5.15", "Motions from A and B"),
    "figure-5.16": Target(
        "Basins at 152.3 rpm", basins_table("figure-5.16"), sized=True
    ),
    "figure-5.17": _motion("figure-5.17", "Motions from C and D"),
    "figure-5.18": Target(
        "Basins at 154.2 rpm", basins_table("figure-5.18"), sized=True, note=_WINDOW
    ),
    "figure-5.19": _motion("figure-5.19", "Motions from E and F"),
    "figure-5.20": Target("Basins at 156 rpm", basins_table("figure-5.20"), sized=True),
    "figure-5.21": _motion("figure-5.21", "Motions from G and H"),
    "figure-5.22": Target(
        "Basins at 160.5 rpm",
        basins_table("figure-5.22"),
        sized=True,
        note=_NO_RINGS,
    ),
    "figure-5.23": Target(
        "Basins at 160.5 rpm, closer",
        basins_table("figure-5.23"),
        sized=True,
        note=_NO_RINGS,
    ),
    "figure-5.24": Target("Sticking time by speed", chatter.figure_5_24),
    "figure-5.25": Target("The local map, measured", local_map.figure_5_25),
    "figure-5.26": Target("Events of the local map", local_map.figure_5_26),
    "figure-5.27": Target("The expressions of the local map", local_map.figure_5_27),
    "figure-5.28": Target(
        "The local map, iterated",
        local_map.figure_5_28,
        sized=True,
        note="Speeds at which the iterated map leaves the largest lobe that was fitted "
        "have no dots.",
    ),
    "table-6.1": Target("End of chattering below its interruption", table_6_1),
    "table-6.2": Target("The lambda-map up to the accumulation", table_6_2),
    "table-6.3": Target("The speed of the cam in the local map", table_6_3),
    "table-6.4": Target("Closing the loop at the interruption", table_6_4),
    "figure-6.2": Target("The grazing manifold", manifold.figure_6_2),
    "figure-6.3": Target("Motions from the grazing manifold", manifold.figure_6_3),
    "figure-6.4": Target("More of the grazing manifold", manifold.figure_6_4),
    "figure-6.5": Target("The scalar map of chattering", sequence.figure_6_5),
    "figure-6.6": Target("Impacts of a chattering sequence", sequence.figure_6_6),
    "figure-6.7": Target("Where the local analysis applies", sequence.figure_6_9),
    "figure-6.9": Target("The orbit at 152.67 rpm", sequence.figure_6_9),
    "figure-6.10": Target("Its chattering, closer", sequence.figure_6_9),
    "figure-6.11": Target("Impacts by the local map", sequence.figure_6_11),
    "figure-6.12": Target("The jerk at release", sequence.figure_6_12),
    "figure-6.14": Target("Section after a change of state", rebuilt.figure_6_14),
    "figure-6.15": Target("Section after a change of speed", rebuilt.figure_6_15),
    "figure-6.16": Target("Section after a whole turn", rebuilt.figure_6_16),
}


def reproduce(name: str, system: CamFollower, size: Size = "default") -> "pd.DataFrame":
    """A table of the thesis or the numbers of a figure, printed beside computed.

    **Arguments:**

    - `name`: a key of [`jaxcam.thesis.TARGETS`][], such as "table-5.2".
    - `system`: the rig, such as `jaxcam.models.preset("calibrated")`.
    - `size`: "full" for diagrams and basins as fine as published ones.

    **Returns:** columns quantity, printed, computed, unit, difference, relative (the
    difference over the size of the printed value); speeds in rpm and everything else in
    SI units. NaN where the rig has no such thing, and under printed where the thesis
    draws something but gives no number.

    **Raises:** `ValueError` for an unknown name.
    """
    if name not in TARGETS:
        known = ", ".join(TARGETS)
        raise ValueError(f"There is no {name!r} to reproduce; choose one of {known}.")
    target = TARGETS[name]
    return target.compute(system, size) if target.sized else target.compute(system)
