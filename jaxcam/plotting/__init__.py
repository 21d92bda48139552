"""Figures, in one style. Imported by the command line and notebooks only."""

from ._compare_recording import compare_recording as compare_recording
from ._impact_map import impact_map as impact_map
from ._phase_portrait import phase_portrait as phase_portrait
from ._residual_by_mode import residual_by_mode as residual_by_mode
from ._style import save_figure as save_figure, style as style
from ._time_history import time_history as time_history
