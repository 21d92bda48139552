"""What a hybrid system is, and its exact trajectory."""

from ._flow import flow as flow
from ._settings import Settings as Settings
from ._simulate import simulate as simulate
from ._stroboscope import stroboscope as stroboscope
from ._system import HybridSystem as HybridSystem
from .codes import RESULTS as RESULTS
from .record import Trajectory as Trajectory
