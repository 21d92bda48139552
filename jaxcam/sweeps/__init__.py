"""Compute bifurcation diagrams, charts and basins of attraction from many motions."""

from ._basins import basins as basins
from ._basins_result import Basins as Basins
from ._boundary import (
    basin_entropy as basin_entropy,
    uncertainty_exponent as uncertainty_exponent,
)
from ._cell_mapping import cell_mapping as cell_mapping
from ._chart import chart as chart
from ._chart_result import Chart as Chart
from ._diagram import diagram as diagram
from ._diagram_result import Diagram as Diagram
from ._exponents import largest_exponents as largest_exponents
from ._follow import follow_basins as follow_basins
from ._grid import Grid as Grid
from ._load import load_sweep as load_sweep
from ._starts import monte_carlo as monte_carlo
from .blocks import cluster as cluster
from .sections import (
    ImpactSection as ImpactSection,
    Map as Map,
    PoincareSection as PoincareSection,
    return_times as return_times,
    Stroboscopic as Stroboscopic,
)
