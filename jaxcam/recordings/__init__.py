"""Recordings: reading, sensors, segmentation, and comparison with a model."""

from ._drive import Drive as Drive, read_drive as read_drive
from ._errors import RecordingError as RecordingError, RigError as RigError
from ._recording import Case as Case, Recording as Recording
from ._rig import (
    Gyro as Gyro,
    Quantity as Quantity,
    References as References,
    Rig as Rig,
    Sensors as Sensors,
)
from ._synthetic import record as record, Wandering as Wandering
from .against_model import (
    compare as compare,
    merge as merge,
    Residuals as Residuals,
    Row as Row,
)
from .cut import (
    Contact as Contact,
    Flight as Flight,
    Impacts as Impacts,
    segment as segment,
    segment_case as segment_case,
    Segments as Segments,
)
from .files import (
    mend as mend,
    read_case as read_case,
    read_recording as read_recording,
    read_rig as read_rig,
)
