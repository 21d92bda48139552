"""Assess a verdict: bootstrap, held-out data, residual structure, detection limits."""

from ._choice import Choice as Choice, choose as choose
from ._differing import above_noise as above_noise, Differing as Differing
from ._held_out import HeldOut as HeldOut, rms_of as rms_of
from ._limits import Limit as Limit, limits as limits
from ._not_shared import not_shared as not_shared
from ._redrawn import Needs as Needs
from ._ripple import Ripple as Ripple, ripple_of as ripple_of
from ._rivals import Rival as Rival
from ._shares import (
    misfit_by_part as misfit_by_part,
    Shares as Shares,
    shares as shares,
)
from ._structure import (
    Form as Form,
    Structure as Structure,
)
from ._supported import Outside as Outside
from ._unnamed import Rejected as Rejected
from ._visited_states import (
    visited_states as visited_states,
    VisitedStates as VisitedStates,
)
from ._whole_flights import (
    whole_flights as whole_flights,
    WholeFlights as WholeFlights,
)
