"""Meaning of the colours in all figures, for figures drawn elsewhere."""

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
