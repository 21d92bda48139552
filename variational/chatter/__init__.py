"""Analyse chatter with maps, from impact to impact and from period to period."""

from ._adding import adding_thresholds as adding_thresholds
from ._beta_map import (
    beta_map as beta_map,
    beta_parts as beta_parts,
    BetaMap as BetaMap,
)
from ._chatter_frame import (
    chatter_frame as chatter_frame,
    ChatterFrame as ChatterFrame,
    frame_at as frame_at,
    parameter_incidence as parameter_incidence,
    prepared_frame as prepared_frame,
)
from ._chatter_orbit import (
    chatter_accumulation as chatter_accumulation,
    ChatterOrbit as ChatterOrbit,
    orbit_from as orbit_from,
)
from ._composed_map import (
    composed_map as composed_map,
    ComposedMap as ComposedMap,
    simulated_at_section as simulated_at_section,
    simulated_by_parameter as simulated_by_parameter,
)
from ._find_lobes import find_lobes as find_lobes, Lobes as Lobes
from ._free_flight import fly as fly
from ._grazing_manifold import (
    chattering_region as chattering_region,
    grazing_manifold as grazing_manifold,
    GrazingManifold as GrazingManifold,
    ImpactCurve as ImpactCurve,
)
from ._impact_map import (
    impact_jacobian as impact_jacobian,
    impact_map as impact_map,
    ImpactPoint as ImpactPoint,
    next_impact as next_impact,
    surface_state as surface_state,
)
from ._interruption import (
    chatter_interruption as chatter_interruption,
    Interruption as Interruption,
    interruption_in as interruption_in,
)
from ._interruption_margin import interruption_margin as interruption_margin
from ._lambda_map import (
    hop_ratio as hop_ratio,
    koenigs as koenigs,
    lambda_inverse as lambda_inverse,
    lambda_map as lambda_map,
)
from ._local_map import (
    fit_local_map as fit_local_map,
    iterate_local_map as iterate_local_map,
    LocalMap as LocalMap,
)
from ._reversed import Reversed as Reversed
from ._scaling_law import scaling_law as scaling_law, ScalingLaw as ScalingLaw
from ._section_turn import (
    release_impacts as release_impacts,
    section_to_impact as section_to_impact,
    section_turn as section_turn,
    SectionArrival as SectionArrival,
    to_section as to_section,
)
