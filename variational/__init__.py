"""Derivatives of trajectories: orbits, saltation matrices, monodromy, multipliers."""

from ._adding import adding_thresholds as adding_thresholds
from ._beta_map import (
    beta_map as beta_map,
    beta_parts as beta_parts,
    BetaMap as BetaMap,
)
from ._chatter_frame import (
    chatter_frame as chatter_frame,
    ChatterFrame as ChatterFrame,
    parameter_incidence as parameter_incidence,
)
from ._chatter_orbit import (
    chatter_accumulation as chatter_accumulation,
    ChatterOrbit as ChatterOrbit,
)
from ._composed_map import (
    composed_map as composed_map,
    ComposedMap as ComposedMap,
    simulated_at_section as simulated_at_section,
    simulated_by_parameter as simulated_by_parameter,
)
from ._covariant import (
    covariant_vectors as covariant_vectors,
    CovariantVectors as CovariantVectors,
)
from ._filippov import (
    filippov_monodromy as filippov_monodromy,
    filippov_saltation as filippov_saltation,
)
from ._floquet import (
    floquet_multipliers as floquet_multipliers,
    impact_scale as impact_scale,
    Stability as Stability,
    stability as stability,
    test_functions as test_functions,
)
from ._free_flight import fly as fly
from ._grazing import grazing_form as grazing_form, GrazingForm as GrazingForm
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
from ._lambda_map import (
    hop_ratio as hop_ratio,
    koenigs as koenigs,
    lambda_inverse as lambda_inverse,
    lambda_map as lambda_map,
)
from ._local_map import (
    find_lobes as find_lobes,
    fit_local_map as fit_local_map,
    iterate_local_map as iterate_local_map,
    Lobes as Lobes,
    LocalMap as LocalMap,
)
from ._lyapunov import (
    lyapunov_spectrum as lyapunov_spectrum,
    LyapunovSpectrum as LyapunovSpectrum,
)
from ._monodromy import monodromy as monodromy, turn_derivative as turn_derivative
from ._multipliers import eigenvalues as eigenvalues
from ._nordmark import nordmark_map as nordmark_map, nordmark_window as nordmark_window
from ._orbit import Event as Event, Orbit as Orbit, orbit_of as orbit_of
from ._poincare import poincare_derivative as poincare_derivative
from ._reversed import Reversed as Reversed
from ._saltation import (
    event_map as event_map,
    saltation_at_release as saltation_at_release,
    saltation_into_contact as saltation_into_contact,
    saltation_matrix as saltation_matrix,
    saltation_parts as saltation_parts,
    saltation_second as saltation_second,
    SaltationParts as SaltationParts,
)
from ._scaling_law import scaling_law as scaling_law, ScalingLaw as ScalingLaw
from ._section_turn import (
    release_impacts as release_impacts,
    Section as Section,
    section_to_impact as section_to_impact,
    section_turn as section_turn,
    to_section as to_section,
)
from ._turn_derivative import TurnDerivative as TurnDerivative
