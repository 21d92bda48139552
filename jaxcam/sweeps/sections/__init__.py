"""Sample many motions on a section."""

from ._impact_section import ImpactSection as ImpactSection
from ._map import Map as Map
from ._poincare_section import (
    PoincareSection as PoincareSection,
    return_times as return_times,
)
from ._samples import (
    BEHIND as BEHIND,
    filled as filled,
    Samples as Samples,
    with_lanes as with_lanes,
)
from ._section import (
    AbstractSection as AbstractSection,
    component_coordinates as component_coordinates,
)
from ._stroboscopic import Stroboscopic as Stroboscopic
