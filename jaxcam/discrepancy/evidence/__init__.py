"""Assess a verdict: bootstrap, held-out records, residual structure, limits."""

from ._choice import Choice as Choice, choose as choose
from ._held_out import HeldOut as HeldOut, rms_of as rms_of
from ._limits import Limit as Limit, limits as limits
from ._redrawn import Needs as Needs
from ._ripple import Ripple as Ripple, ripple_of as ripple_of
from ._structure import (
    Form as Form,
    ranges_of as ranges_of,
    Structure as Structure,
)
