"""Simulate many trajectories, of which a smaller number run at the same time."""

from ..loop import loop_state as loop_state
from ._layout import Horizon as Horizon, Lanes as Lanes, split_lanes as split_lanes
from ._refilled_lanes import Chunking as Chunking, run_refilled as run_refilled
from ._table import Table as Table
from ._tangents import run_tangents as run_tangents
from ._turn_samples import TurnSamples as TurnSamples
