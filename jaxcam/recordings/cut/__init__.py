"""Segment recordings into flights, contacts and impacts, on an estimated surface."""

from .._drive import Drive as Drive, read_drive as read_drive
from .._saturated import saturated as saturated
from ._fast_speed import (
    fast_speed as fast_speed,
    usual_acceleration as usual_acceleration,
)
from ._gaps import (
    gap_jumps as gap_jumps,
    given_contacts as given_contacts,
    segment_gaps as segment_gaps,
)
from ._given_impacts import GivenImpact as GivenImpact, GivenImpacts as GivenImpacts
from ._oscillation import (
    hides_kinks as hides_kinks,
    oscillation_period as oscillation_period,
)
from ._padding import padded as padded
from ._polynomial import (
    fit_local as fit_local,
    least_noise as least_noise,
    measured_noise as measured_noise,
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
from ._surface_fit import fit_surface as fit_surface, refine_surface as refine_surface
