"""Parameters from recordings and from published numbers, with their uncertainty."""

from ._bootstrap import Bootstrap as Bootstrap, bootstrap as bootstrap
from ._cam_follower import (
    cam_follower_model as cam_follower_model,
    cam_follower_parameters as cam_follower_parameters,
    rig_sensors as rig_sensors,
)
from ._doubts import Doubt as Doubt, Reason as Reason
from ._ellipse import Ellipse as Ellipse
from ._fit import (
    fit as fit,
    held_out_cost as held_out_cost,
    total_cost as total_cost,
)
from ._fit_result import Estimate as Estimate, Fit as Fit
from ._identify import Identifiability as Identifiability, identify as identify
from ._profile import (
    excess_cost as excess_cost,
    Profile as Profile,
    profile as profile,
)
from ._read_setup import is_setup as is_setup, read_setup as read_setup
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
from ._segment_by_model import segment_by_model as segment_by_model
from ._setup import Setup as Setup
from ._unconstrained import Unconstrained as Unconstrained
from .engine import (
    Input as Input,
    Model as Model,
    Parameter as Parameter,
    Problem as Problem,
    Sensor as Sensor,
    Turning as Turning,
)
from .published import (
    fit_published as fit_published,
    interruption_of_chattering as interruption_of_chattering,
    Published as Published,
    PublishedFit as PublishedFit,
)
