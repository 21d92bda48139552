"""Parameters from recordings and from published numbers, with their uncertainty."""

from ._bootstrap import Bootstrap as Bootstrap, bootstrap as bootstrap
from ._cam_follower import (
    cam_follower_model as cam_follower_model,
    cam_follower_parameters as cam_follower_parameters,
    rig_sensors as rig_sensors,
)
from ._ellipse import Ellipse as Ellipse
from ._find_orbits import one_impact_orbits as one_impact_orbits
from ._fit import fit as fit, held_out_cost as held_out_cost
from ._fit_result import Estimate as Estimate, Fit as Fit
from ._free_fall import fit_free_fall as fit_free_fall, FreeFall as FreeFall
from ._grazing_point import graze_of_orbit as graze_of_orbit
from ._identify import Identifiability as Identifiability, identify as identify
from ._impact_orbit import (
    clearance as clearance,
    fly as fly,
    impact_orbit as impact_orbit,
    ImpactOrbit as ImpactOrbit,
    orbit_determinant as orbit_determinant,
    orbit_monodromy as orbit_monodromy,
    orbit_residual as orbit_residual,
    orbit_trace as orbit_trace,
)
from ._implicit import implicit_root as implicit_root
from ._interruption_point import (
    interruption_of_chattering as interruption_of_chattering,
)
from ._model import (
    cam_follower_drive as cam_follower_drive,
    Input as Input,
    Model as Model,
    Sensor as Sensor,
    Turning as Turning,
)
from ._parameter import Parameter as Parameter
from ._problem import Problem as Problem, Weights as Weights
from ._profile import (
    excess_cost as excess_cost,
    Profile as Profile,
    profile as profile,
)
from ._published import (
    fit_published as fit_published,
    Published as Published,
    rounding_error as rounding_error,
)
from ._published_fit import PublishedFit as PublishedFit
from ._residuals import Residuals as Residuals, residuals as residuals
from ._restitution import (
    first_bounce as first_bounce,
    fit_restitution as fit_restitution,
    restitution_laws as restitution_laws,
    RestitutionFit as RestitutionFit,
)
from ._reverse import (
    cost_and_gradient as cost_and_gradient,
    train as train,
    Trained as Trained,
)
from ._score import linearise as linearise, Linearised as Linearised
from ._special_points import (
    detachment as detachment,
    flip_of_orbit as flip_of_orbit,
    fold_of_orbit as fold_of_orbit,
    orbit_where as orbit_where,
    release_near as release_near,
    SpecialPoint as SpecialPoint,
)
