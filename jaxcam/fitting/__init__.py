"""Estimate parameters from recordings or from published values."""

from ._bootstrap import Bootstrap as Bootstrap, bootstrap as bootstrap
from ._cam_follower import (
    cam_follower_model as cam_follower_model,
    cam_follower_parameters as cam_follower_parameters,
    rig_sensors as rig_sensors,
)
from ._doubts import Doubt as Doubt
from ._first_bounce import first_bounce as first_bounce
from ._fit import fit as fit, held_out_cost as held_out_cost
from ._fit_free_run import fit_free_run as fit_free_run, FreeRunFit as FreeRunFit
from ._fit_result import Fit as Fit
from ._free_run import free_run as free_run, FreeRun as FreeRun
from ._identify import Identifiability as Identifiability, identify as identify
from ._impact_law import impact_law as impact_law, ImpactLaw as ImpactLaw
from ._lags import without_lags as without_lags
from ._profile import excess_cost as excess_cost, profile as profile
from ._read_setup import is_setup as is_setup, read_setup as read_setup
from ._residuals import Residuals as Residuals, residuals as residuals
from ._restitution import (
    fit_restitution as fit_restitution,
    restitution_laws as restitution_laws,
    RestitutionFit as RestitutionFit,
)
from ._reverse import train as train
from ._score import linearise as linearise
from ._segment_by_model import segment_by_model as segment_by_model
from ._setup import Setup as Setup
from .engine import (
    Input as Input,
    Model as Model,
    Output as Output,
    Parameter as Parameter,
    Problem as Problem,
    Sensor as Sensor,
    Turning as Turning,
)
from .published import (
    fit_published as fit_published,
    interruption_of_chattering as interruption_of_chattering,
    Published as Published,
)
