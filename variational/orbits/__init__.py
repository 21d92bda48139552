"""Compute periodic orbits.

`continuation` and `jaxcam.fitting` use this package; its public interface is
`variational`.
"""

from ._admissible import inadmissible as inadmissible, refuse as refuse
from ._at_grazing import multipliers_at_grazing as multipliers_at_grazing
from ._builder import builder as builder, picked as picked
from ._direction import direction_of as direction_of
from ._flight import flight_end as flight_end, flight_nodes as flight_nodes
from ._gap_sizes import gap_sizes as gap_sizes
from ._impact_orbit import (
    clearance as clearance,
    impact_orbit as impact_orbit,
    ImpactOrbit as ImpactOrbit,
    orbit_determinant as orbit_determinant,
    orbit_monodromy as orbit_monodromy,
    orbit_trace as orbit_trace,
)
from ._implicit import implicit_root as implicit_root
from ._links import (
    antiperiodic as antiperiodic,
    around_the_period as around_the_period,
    equations_and_monodromy as equations_and_monodromy,
    links_of as links_of,
    monodromy_of as monodromy_of,
    product_of_links as product_of_links,
    return_map as return_map,
)
from ._lowest_gap import lowest_times as lowest_times
from ._monodromy import (
    Method as Method,
    monodromy as monodromy,
    turn_derivative as turn_derivative,
)
from ._multipliers import eigenvalues as eigenvalues
from ._one_impact import one_impact_orbits as one_impact_orbits
from ._orbit import (
    Event as Event,
    events_in_time as events_in_time,
    Orbit as Orbit,
    orbit_of as orbit_of,
)
from ._period_map import fixed_by_flow as fixed_by_flow
from ._seeds import seed as seed, steps_for as steps_for
from ._shooting import PaddedShooting as PaddedShooting, Shooting as Shooting
from ._shooting_equations import AbstractShooting as AbstractShooting, Seen as Seen
from ._special_points import (
    detachment as detachment,
    flip_of_orbit as flip_of_orbit,
    fold_of_orbit as fold_of_orbit,
    graze_of_orbit as graze_of_orbit,
    orbit_where as orbit_where,
    release_near as release_near,
    SpecialPoint as SpecialPoint,
)
from ._turn_derivative import (
    by_product as by_product,
    flown as flown,
    TurnDerivative as TurnDerivative,
)
