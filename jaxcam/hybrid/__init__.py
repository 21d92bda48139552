"""Simulate hybrid systems with exact event detection.

Equation numbers in docstrings ("thesis, eq. 2.24") are those of R. Alzate, *Analysis
and Application of Bifurcations in Systems with Impacts and Chattering*, University of
Naples Federico II, 2008; `jaxcam.citation("thesis")` prints its entry.
"""

from ._automaton import HybridAutomaton as HybridAutomaton
from ._corners import Corner as Corner, corners as corners
from ._flow import flow as flow
from ._settings import Settings as Settings
from ._simulate import simulate as simulate
from ._stroboscope import stroboscope as stroboscope
from ._switched import SwitchedSystem as SwitchedSystem
from ._system import HybridSystem as HybridSystem
from ._wrapping import SwitchedWrapping as SwitchedWrapping, Wrapping as Wrapping
from .caches import clear_caches as clear_caches
from .codes import RESULTS as RESULTS
from .record import Trajectory as Trajectory
