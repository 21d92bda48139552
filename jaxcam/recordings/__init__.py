"""Read and check recordings, segment them into flights and contacts, and compare
them with a model.
"""

from ._errors import RecordingError as RecordingError, RigError as RigError
from ._impact_table import ImpactTable as ImpactTable
from ._recording import Recording as Recording
from ._rig import References as References, Rig as Rig
from ._synthetic import record as record, Wandering as Wandering
from .against_model import compare as compare, merge as merge
from .cut import (
    segment as segment,
    segment_case as segment_case,
    Segments as Segments,
)
from .files import (
    mend as mend,
    read_case as read_case,
    read_impacts as read_impacts,
    read_recording as read_recording,
    read_rig as read_rig,
)
