"""Find the attractors of motions, and label them."""

from ._attractors import (
    attractor_names as attractor_names,
    Attractors as Attractors,
    find_attractors as find_attractors,
)
from ._drifting import drifting as drifting
from ._fingerprint import (
    cell_codes as cell_codes,
    fingerprint_size as fingerprint_size,
    fingerprints as fingerprints,
)
from ._label import (
    APERIODIC as APERIODIC,
    CONTACT as CONTACT,
    label as label,
    label_name as label_name,
    label_names as label_names,
    Labels as Labels,
    OUTSIDE as OUTSIDE,
    periods as periods,
    STICKING as STICKING,
)
from ._match import match_orbits as match_orbits
from ._settle import settle as settle
from ._unique_rows import unique_rows as unique_rows
