"""From files to recordings and rigs: numbers with units, faults by their names."""

from ._check import check_channels as check_channels, check_drive as check_drive
from ._mend import mend as mend, Mended as Mended
from ._read import (
    CAM_FOLLOWER as CAM_FOLLOWER,
    read_case as read_case,
    read_recording as read_recording,
    read_recordings as read_recordings,
)
from ._read_rig import read_references as read_references, read_rig as read_rig
from ._toml import (
    known_keys as known_keys,
    printable as printable,
    read_tables as read_tables,
    Section as Section,
    shown_value as shown_value,
)
from ._units import si as si, unit_of as unit_of
