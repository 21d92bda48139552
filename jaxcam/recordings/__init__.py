"""Recordings: reading, sensors, segmentation, and comparison with a model."""

from ._compare import compare as compare, compare_case as compare_case
from ._comparison import (
    Comparison as Comparison,
    merge as merge,
    Residuals as Residuals,
    Row as Row,
)
from ._drive import Drive as Drive, read_drive as read_drive
from ._errors import RecordingError as RecordingError, RigError as RigError
from ._mend import mend as mend, Mended as Mended
from ._read import (
    CAM_FOLLOWER as CAM_FOLLOWER,
    read_case as read_case,
    read_recording as read_recording,
    read_recordings as read_recordings,
)
from ._read_rig import read_rig as read_rig
from ._recording import Case as Case, Recording as Recording
from ._rig import (
    Gyro as Gyro,
    Quantity as Quantity,
    Rig as Rig,
    Sensors as Sensors,
)
from ._segment import segment as segment, segment_case as segment_case
from ._segments import (
    Boundary as Boundary,
    Contact as Contact,
    Flight as Flight,
    Impacts as Impacts,
    Segments as Segments,
)
from ._surface import nominal_surface as nominal_surface, Surface as Surface
from ._surface_fit import (
    fit_surface as fit_surface,
    refine_surface as refine_surface,
)
from ._synthetic import record as record, Wandering as Wandering
