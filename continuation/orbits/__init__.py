"""Periodic orbits of hybrid systems as continuation problems."""

from ._periodic import periodic_orbits as periodic_orbits, start_of as start_of
from ._periodic_orbit import periodic_orbit as periodic_orbit
from ._periodic_seeds import orbits_near as orbits_near
from ._periodic_sticking import StickingOrbits as StickingOrbits
from ._shooting import ImpactingOrbits as ImpactingOrbits
from ._single_shooting import SingleShooting as SingleShooting
