"""From files to recordings and rigs: numbers with units, faults by their names."""

from ._check import check_channels as check_channels, check_drive as check_drive
from ._mend import mend as mend, Mended as Mended
from ._read import (
    CAM_FOLLOWER as CAM_FOLLOWER,
    read_case as read_case,
    read_recording as read_recording,
    read_recordings as read_recordings,
)
from ._read_rig import read_rig as read_rig
