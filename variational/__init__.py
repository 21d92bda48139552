"""Compute derivatives of trajectories: saltation matrices, monodromy matrices and
multipliers.
"""

from ._covariant import covariant_vectors as covariant_vectors
from ._grazing import grazing_form as grazing_form, GrazingForm as GrazingForm
from ._lyapunov import lyapunov_spectrum as lyapunov_spectrum
from ._nordmark import nordmark_map as nordmark_map, nordmark_window as nordmark_window
from ._poincare import poincare_derivative as poincare_derivative
from ._switching import switching_saltation as switching_saltation
from .chatter import (
    adding_thresholds as adding_thresholds,
    beta_map as beta_map,
    chatter_accumulation as chatter_accumulation,
    chatter_frame as chatter_frame,
    chatter_interruption as chatter_interruption,
    chattering_region as chattering_region,
    composed_map as composed_map,
    find_lobes as find_lobes,
    fit_local_map as fit_local_map,
    grazing_manifold as grazing_manifold,
    impact_jacobian as impact_jacobian,
    impact_map as impact_map,
    iterate_local_map as iterate_local_map,
    koenigs as koenigs,
    lambda_inverse as lambda_inverse,
    lambda_map as lambda_map,
    Reversed as Reversed,
    scaling_law as scaling_law,
    section_turn as section_turn,
    simulated_at_section as simulated_at_section,
)
from .floquet import floquet_multipliers as floquet_multipliers, stability as stability
from .orbits import (
    detachment as detachment,
    flip_of_orbit as flip_of_orbit,
    fold_of_orbit as fold_of_orbit,
    graze_of_orbit as graze_of_orbit,
    impact_orbit as impact_orbit,
    monodromy as monodromy,
    Orbit as Orbit,
    orbit_determinant as orbit_determinant,
    orbit_of as orbit_of,
    orbit_trace as orbit_trace,
    orbit_where as orbit_where,
    release_near as release_near,
    turn_derivative as turn_derivative,
)
from .saltation import (
    event_map as event_map,
    saltation_matrix as saltation_matrix,
    saltation_parts as saltation_parts,
)
