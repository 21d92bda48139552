"""The meaning of the colours in all figures, for use in other figures."""

from ._style import (
    BAND as BAND,
    CAM as CAM,
    CONTACT as CONTACT,
    FLIGHT as FLIGHT,
    IMPACT as IMPACT,
    RECORDED as RECORDED,
    SECOND as SECOND,
    SECTION as SECTION,
)
