"""Draw figures in a uniform style."""

from ._basins import basin_picture as basin_picture
from ._branch import branch_diagram as branch_diagram
from ._cam_contour import cam_contour as cam_contour
from ._chatter_maps import (
    beta_lobes as beta_lobes,
    lambda_cobweb as lambda_cobweb,
    lobe_scaling as lobe_scaling,
)
from ._chatter_region import chattering_picture as chattering_picture
from ._compare_recording import compare_recording as compare_recording
from ._dark import on_dark as on_dark
from ._diagram import sweep_chart as sweep_chart, sweep_diagram as sweep_diagram
from ._grazing_map import cobweb as cobweb
from ._impact_map import impact_return_map as impact_return_map
from ._local_map import local_map as local_map
from ._lyapunov import lyapunov_convergence as lyapunov_convergence
from ._motion_program import motion_program as motion_program
from ._multipliers import multipliers as multipliers
from ._phase_portrait import phase_portrait as phase_portrait
from ._residual_by_mode import residual_by_mode as residual_by_mode
from ._special_curves import special_curves as special_curves
from ._style import save_figure as save_figure, style as style
from ._time_history import time_history as time_history
