"""Read recordings and rigs from files, with units and precise error messages."""

from .._recording import Case as Case
from .._units import (
    si as si,
    si_of as si_of,
    unit_of as unit_of,
    without_unit as without_unit,
)
from ._check import check_channels as check_channels, check_drive as check_drive
from ._choose import Columns as Columns
from ._mend import mend as mend, Mended as Mended
from ._read import (
    CAM_FOLLOWER as CAM_FOLLOWER,
    has_recordings as has_recordings,
    read_case as read_case,
    read_recording as read_recording,
    read_recordings as read_recordings,
)
from ._read_impacts import (
    is_impact_table as is_impact_table,
    read_impacts as read_impacts,
)
from ._read_layout import (
    FileLayout as FileLayout,
    LAYOUT_KEYS as LAYOUT_KEYS,
    read_layout as read_layout,
)
from ._read_rig import read_references as read_references, read_rig as read_rig
from ._toml import (
    known_keys as known_keys,
    printable as printable,
    read_tables as read_tables,
    Section as Section,
    shown_value as shown_value,
)
