"""The record of a run: events, contacts and steps, and the state between them."""

from ._assemble import assemble as assemble, Parts as Parts
from ._events import (
    Contacts as Contacts,
    impact_table as impact_table,
    Impacts as Impacts,
    Steps as Steps,
    Switches as Switches,
    SwitchKind as SwitchKind,
)
from ._modes import automaton as automaton, Modes as Modes
from ._printed import Printed as Printed, vector_text as vector_text
from ._trajectory import Trajectory as Trajectory
